//! The text of a CSV file: opened, its marks and header judged, then handed out in blocks of whole lines.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};

use crate::error::{InputError, InputProblem, listed};
use crate::rows::{Fields, Layout, without_end};

/// Bytes in a block of text, but for the end of its last line.
const BLOCK: usize = 1 << 20;

/// A file as blocks of whole lines.
#[derive(Debug)]
pub(crate) struct Blocks {
    file: PathBuf,
    input: File,
    /// The beginning of a line whose end was not read yet.
    rest: Vec<u8>,
}

impl Blocks {
    /// Opens the file and skips its byte-order mark.
    pub fn open(file: &Path) -> Result<Self, InputError> {
        let mut input = open(file)?;
        skip_mark(file, &mut input)?;
        Ok(Self { file: file.to_path_buf(), input, rest: Vec::new() })
    }

    /// The next block; empty at the end of the file. Only the last line of the file may have no end.
    pub fn next_block(&mut self) -> Result<Vec<u8>, InputError> {
        let mut block = std::mem::take(&mut self.rest);
        loop {
            let before = block.len();
            block.reserve(BLOCK);
            let read = (&mut self.input)
                .take(BLOCK as u64)
                .read_to_end(&mut block)
                .map_err(|e| InputError::whole(&self.file, InputProblem::from_io(&e)))?;
            if read == 0 {
                return Ok(block);
            }
            if let Some(last) = block[before..].iter().rposition(|&b| b == b'\n') {
                self.rest = block.split_off(before + last + 1);
                return Ok(block);
            }
        }
    }
}

/// A file behind its header.
pub(crate) struct Source {
    pub blocks: Blocks,
    pub layout: Layout,
    /// The first block, read up to `at`.
    pub text: Vec<u8>,
    pub at: usize,
    /// Lines up to there.
    pub lines: u64,
}

/// Opens a file and reads its header; `select` names the columns wanted (`None`: all of them).
pub(crate) fn start(file: &Path, select: Option<&[&str]>) -> Result<Source, InputError> {
    let mut blocks = Blocks::open(file)?;
    let mut text = blocks.next_block()?;
    let (names, at, lines) = loop {
        match header(file, &text) {
            // Nothing but blank lines so far.
            Err(e) if e.problem == InputProblem::Empty => {
                let more = blocks.next_block()?;
                if more.is_empty() {
                    return Err(e);
                }
                text.extend(more);
            }
            other => break other?,
        }
    };
    let index_of = |name: &&str| {
        names.iter().position(|n| n == name).ok_or_else(|| {
            let has = listed(names.iter().map(String::as_str));
            InputError::in_column(file, name, InputProblem::MissingColumn(has))
        })
    };
    let selected = match select {
        None => (0..names.len()).collect(),
        Some(wanted) => wanted.iter().map(index_of).collect::<Result<Vec<_>, _>>()?,
    };
    Ok(Source { blocks, layout: Layout::new(file.to_path_buf(), names, selected), text, at, lines })
}

/// The names in the header, which is the first line of `text` that is not blank; the bytes and the lines up to its end.
fn header(file: &Path, text: &[u8]) -> Result<(Vec<String>, usize, u64), InputError> {
    let (mut bytes, mut line) = (0, 0);
    let row = loop {
        if bytes == text.len() {
            return Err(InputError::whole(file, InputProblem::Empty));
        }
        let rest = &text[bytes..];
        let len = rest.iter().position(|&b| b == b'\n').map_or(rest.len(), |n| n + 1);
        bytes += len;
        line += 1;
        let row = without_end(&rest[..len]);
        if !row.is_empty() {
            break row;
        }
    };
    if row.contains(&b'\r') {
        return Err(InputError::at(file, line, None, InputProblem::CarriageReturns));
    }
    let mut fields = Fields::default();
    fields.split(row);
    let at = |column: Option<&str>, problem| InputError::at(file, line, column, problem);
    let names = (0..fields.len())
        .map(|i| std::str::from_utf8(fields.get(row, i)).map(|name| name.trim().to_owned()))
        .collect::<Result<Vec<_>, _>>()
        .map_err(|_| at(None, InputProblem::NotUtf8("")))?;
    if names.iter().any(|name| name.contains('\0')) {
        return Err(at(None, InputProblem::NotUtf8(" (zero bytes: UTF-16 or a binary file)")));
    }
    if let [single] = names.as_slice() {
        let wrong = if single.contains(';') {
            Some("semicolons")
        } else if single.contains('\t') {
            Some("tabs")
        } else if single.contains('|') {
            Some("bars")
        } else {
            None
        };
        if let Some(what) = wrong {
            return Err(at(None, InputProblem::WrongSeparator(what)));
        }
    }
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err(at(None, InputProblem::NoHeader));
    }
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(at(Some(&(i + 1).to_string()), InputProblem::UnnamedColumn));
        }
        if names[..i].contains(name) {
            return Err(at(Some(name), InputProblem::DuplicateColumn));
        }
    }
    Ok((names, bytes, line))
}

fn open(file: &Path) -> Result<File, InputError> {
    let whole = |error: &std::io::Error| InputError::whole(file, InputProblem::from_io(error));
    // Looked at before it is opened: a pipe that nobody writes to would never open, and a device may never end.
    let there = std::fs::metadata(file).map_err(|e| whole(&e))?;
    if there.is_dir() {
        return Err(InputError::whole(file, InputProblem::IsDirectory));
    }
    if !there.is_file() {
        return Err(InputError::whole(file, InputProblem::NotAFile));
    }
    File::open(file).map_err(|e| whole(&e))
}

/// Skips the byte-order mark of UTF-8 and refuses those of UTF-16.
fn skip_mark(file: &Path, input: &mut File) -> Result<(), InputError> {
    let mut head = [0_u8; 3];
    let mut filled = 0;
    let io = |e: std::io::Error| InputError::whole(file, InputProblem::from_io(&e));
    while filled < head.len() {
        match input.read(&mut head[filled..]).map_err(io)? {
            0 => break,
            n => filled += n,
        }
    }
    if filled >= 2 && (head[..2] == [0xFF, 0xFE] || head[..2] == [0xFE, 0xFF]) {
        return Err(InputError::at(file, 1, None, InputProblem::NotUtf8(" (a UTF-16 byte-order mark)")));
    }
    if filled < 3 || head != [0xEF, 0xBB, 0xBF] {
        input.rewind().map_err(io)?;
    }
    Ok(())
}
