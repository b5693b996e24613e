//! Where in a JSON text an error stands: the key there, as `terms[0].coefficient`.

/// An object with the key last read, or an array with the number of the element that is being read.
enum Level {
    Object(String),
    Array(usize),
}

/// The key (with those around it) whose value is being read at `line` and `column`, both counted from 1; empty at the top.
///
/// The text is valid JSON up to there.
pub(crate) fn key_at(text: &str, line: usize, column: usize) -> String {
    let start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    let before = text.as_bytes().get(..(start + column).min(text.len())).unwrap_or_default();
    let mut levels: Vec<Level> = Vec::new();
    let mut at = 0;
    // The last string, which is a key if a colon follows.
    let mut last = "";
    while let Some(&byte) = before.get(at) {
        at += 1;
        match byte {
            b'"' => {
                let from = at;
                while before.get(at).is_some_and(|b| *b != b'"') {
                    at += if before.get(at) == Some(&b'\\') { 2 } else { 1 };
                }
                last = text.get(from..at.min(text.len())).unwrap_or_default();
                at += 1;
            }
            b'{' => levels.push(Level::Object(String::new())),
            b'[' => levels.push(Level::Array(0)),
            b'}' | b']' => {
                levels.pop();
            }
            b':' => {
                if let Some(Level::Object(key)) = levels.last_mut() {
                    last.clone_into(key);
                }
            }
            b',' => match levels.last_mut() {
                Some(Level::Object(key)) => key.clear(),
                Some(Level::Array(n)) => *n += 1,
                None => {}
            },
            _ => {}
        }
    }
    let mut path = String::new();
    for level in &levels {
        match level {
            Level::Object(key) if key.is_empty() => {}
            Level::Object(key) => {
                let dot = if path.is_empty() { "" } else { "." };
                path += &format!("{dot}{key}");
            }
            Level::Array(n) => path += &format!("[{n}]"),
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_told_with_those_around_them() {
        let text = "{\"a\": 1,\n \"terms\": [{\"x\": 1}, {\"x\\\"y,\": [2, 3]}],\n \"b\": \"{,\"}";
        let at = |part: &str, line: usize| {
            let column = text.lines().nth(line - 1).unwrap().find(part).unwrap() + part.len();
            key_at(text, line, column)
        };
        assert_eq!(at("1", 1), "a");
        assert_eq!(at("1", 2), "terms[0].x");
        assert_eq!(at("3", 2), "terms[1].x\\\"y,[1]");
        assert_eq!(at("}]", 2), "terms");
        assert_eq!(at("\"{,\"", 3), "b");
        assert_eq!(key_at(text, 99, 1), "");
        assert_eq!(key_at("", 1, 0), "");
    }
}
