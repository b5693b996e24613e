//! The ways to read a CSV file agree with each other and with the csv crate, whatever the rows look like and wherever blocks end.

use std::path::Path;

use hysid_io::{Chunk, CsvChunks, CsvStream, InputError, InputProblem};
use proptest::prelude::*;

fn by_chunks(file: &Path, select: Option<&[&str]>, rows: usize) -> Result<Chunk, InputError> {
    let mut chunks = CsvChunks::open(file, select, rows)?;
    let mut all = Chunk { columns: vec![Vec::new(); chunks.selected().count()], lines: Vec::new() };
    while let Some(chunk) = chunks.next_chunk()? {
        join(&mut all, chunk);
    }
    Ok(all)
}

fn by_stream(file: &Path, select: Option<&[&str]>) -> Result<Chunk, InputError> {
    let mut stream = CsvStream::open(file, select)?;
    let columns = select.map_or(stream.header().len(), <[&str]>::len);
    let mut all = Chunk { columns: vec![Vec::new(); columns], lines: Vec::new() };
    loop {
        let chunks = stream.next_chunks()?;
        if chunks.is_empty() {
            return Ok(all);
        }
        chunks.into_iter().for_each(|c| join(&mut all, c));
    }
}

fn join(all: &mut Chunk, chunk: Chunk) {
    all.lines.extend(chunk.lines);
    for (a, c) in all.columns.iter_mut().zip(chunk.columns) {
        a.extend(c);
    }
}

/// Bits, so that a missing sample equals a missing sample.
fn bits(read: &Result<Chunk, InputError>) -> Result<(Vec<Vec<u64>>, Vec<u64>), InputError> {
    let chunk = read.as_ref().map_err(Clone::clone)?;
    let one = |x: &f64| if x.is_nan() { u64::MAX } else { x.to_bits() };
    Ok((chunk.columns.iter().map(|c| c.iter().map(one).collect()).collect(), chunk.lines.clone()))
}

/// What the csv crate and the standard library make of the same columns; `None` where there is a fault.
fn by_csv(text: &str, columns: &[usize]) -> Option<Vec<Vec<u64>>> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let mut all = vec![Vec::new(); columns.len()];
    for record in reader.records() {
        let record = record.ok()?;
        for (all, &c) in all.iter_mut().zip(columns) {
            let field = record.get(c)?;
            let x: f64 = if field.is_empty() { f64::NAN } else { field.parse().ok()? };
            if x.abs() > 1e100 {
                return None;
            }
            all.push(if x.is_nan() { u64::MAX } else { x.to_bits() });
        }
    }
    Some(all)
}

fn field() -> impl Strategy<Value = String> {
    prop_oneof![
        12 => any::<f64>().prop_filter("a sample", |x| x.abs() < 1e90).prop_map(|x| x.to_string()),
        12 => (-1e4..1e4_f64, 0..20_usize).prop_map(|(x, d)| format!("{x:.d$}")),
        6 => any::<f64>().prop_filter("a sample", |x| x.abs() < 1e90).prop_map(|x| format!("{x:e}")),
        2 => Just(String::new()),
        2 => Just("NaN".to_string()),
        2 => Just(" 1.5 ".to_string()),
        2 => Just("\"2.5\"".to_string()),
        1 => prop_oneof![Just("x"), Just("1e200"), Just("1,2"), Just("--1"), Just("1e"), Just("+.5"), Just("\"1,5\"")]
            .prop_map(str::to_string),
    ]
}

proptest! {
    #[test]
    fn every_way_reads_the_same(
        rows in proptest::collection::vec(proptest::collection::vec(field(), 3), 1..40),
        end in prop_oneof![Just("\n"), Just("\r\n")],
        ended in any::<bool>(),
        per_chunk in 1..50_usize,
    ) {
        let mut text = format!("a,b,c{end}");
        text.push_str(&rows.iter().map(|r| r.join(",")).collect::<Vec<_>>().join(end));
        text.push_str(if ended { end } else { "" });
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("r.csv");
        std::fs::write(&file, &text).unwrap();
        for (select, columns) in [(vec!["a", "b", "c"], vec![0, 1, 2]), (vec!["c", "a"], vec![2, 0]), (vec!["b"], vec![1])] {
            let whole = bits(&by_chunks(&file, Some(&select), 1000));
            prop_assert_eq!(&whole, &bits(&by_chunks(&file, Some(&select), per_chunk)));
            prop_assert_eq!(&whole, &bits(&by_stream(&file, Some(&select))));
            // Wanted twice, a column is read the slow way.
            let twice: Vec<&str> = select.iter().chain(&select).copied().collect();
            let slow = bits(&by_chunks(&file, Some(&twice), 1000));
            prop_assert_eq!(whole.clone().map(|w| w.0), slow.map(|s| s.0[..select.len()].to_vec()));
            prop_assert_eq!(whole.ok().map(|w| w.0), by_csv(&text, &columns));
        }
    }
}

/// A file of several blocks: the numbers of its lines, its blank lines and its first fault are those of the whole file.
#[test]
fn blocks_do_not_show() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("long.csv");
    let rows = 400_000_u64;
    let mut text = String::from("y\n");
    for n in 0..rows {
        // A blank line is a missing sample of a file with one column; some stand where a block of text ends.
        let blank = n % 1000 < 3 || (100_000..250_000).contains(&n) && n % 3 == 0;
        text.push_str(&if blank { "\n".into() } else { format!("{}\n", n as f64 / 7.0) });
    }
    text.push_str("\n\n");
    std::fs::write(&file, &text).unwrap();
    let (whole, stream) = (by_chunks(&file, None, usize::MAX), by_stream(&file, None));
    assert_eq!(bits(&whole), bits(&stream));
    let chunk = whole.unwrap();
    assert_eq!(chunk.lines, (2..rows + 2).collect::<Vec<_>>());
    assert!(chunk.columns[0].iter().enumerate().all(|(n, y)| y.is_nan() || *y == n as f64 / 7.0));

    for (line, row, problem) in [
        (1_000_002, "0.5,oops", InputProblem::NotANumber("oops".into())),
        (999_999, "0.5,0.5,7", InputProblem::RaggedRow { found: 3, expected: 2 }),
    ] {
        let mut text = String::from("u,y\n");
        for n in 2..1_200_000 {
            text.push_str(if n == line || n == line + 50_000 { row } else { "0.25,-1.5" });
            text.push('\n');
        }
        std::fs::write(&file, &text).unwrap();
        let column = matches!(problem, InputProblem::NotANumber(_)).then(|| "y".to_string());
        let expected = InputError { file: file.clone(), line: Some(line), column, problem };
        assert_eq!(by_stream(&file, None).unwrap_err(), expected);
        assert_eq!(by_chunks(&file, None, 1 << 16).unwrap_err(), expected);
    }
}
