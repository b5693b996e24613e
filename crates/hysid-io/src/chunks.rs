//! A CSV file as a stream of blocks of numbers, for files of any size.
//!
//! The header, the shape of each row and each number are judged here; the clock is judged by [`crate::fit_clock`], which needs the
//! whole time column. A blank line is skipped, except in a file of one column, where it is a missing sample unless it ends the file.
//! A line is a row: a line end within quotes is not understood. Lines are cut here, which keeps their numbers exact; quoted fields are left
//! to the csv crate.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::{Path, PathBuf};

use csv::ByteRecord;

use crate::error::{InputError, InputProblem};
use crate::read::LARGEST_VALUE;

/// Consecutive rows of the columns that were asked for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chunk {
    /// One vector for each column, in the order asked for; all of the same length. A missing sample is `NaN`.
    pub columns: Vec<Vec<f64>>,
    /// The line (from 1) of each row.
    pub lines: Vec<u64>,
}

/// Reads a CSV file block by block.
pub struct CsvChunks {
    file: PathBuf,
    lines: Lines,
    header: Vec<String>,
    selected: Vec<usize>,
    row: Row,
    rows_per_chunk: usize,
    decimals: Vec<u32>,
}

impl CsvChunks {
    /// Opens the file and reads its header; `select` names the columns to parse (`None`: all of them), in the order wanted.
    ///
    /// # Errors
    /// Whatever is wrong with the file or its header: see [`InputProblem`].
    pub fn open(file: &Path, select: Option<&[&str]>, rows_per_chunk: usize) -> Result<Self, InputError> {
        let mut input = open(file)?;
        skip_mark(file, &mut input)?;
        let mut chunks = Self {
            file: file.to_path_buf(),
            lines: Lines { input: BufReader::with_capacity(1 << 18, input), text: Vec::new(), number: 0 },
            header: Vec::new(),
            selected: Vec::new(),
            row: Row::default(),
            rows_per_chunk: rows_per_chunk.max(1),
            decimals: Vec::new(),
        };
        chunks.read_header()?;
        chunks.selected = match select {
            None => (0..chunks.header.len()).collect(),
            Some(names) => names.iter().map(|name| chunks.index_of(name)).collect::<Result<_, _>>()?,
        };
        chunks.decimals = vec![0; chunks.selected.len()];
        Ok(chunks)
    }

    /// The names of all columns, in the order of the file.
    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// The names of the columns that each [`Chunk`] holds.
    pub fn selected(&self) -> impl Iterator<Item = &str> {
        self.selected.iter().filter_map(|&i| self.header.get(i)).map(String::as_str)
    }

    /// The largest number of decimals with which the `i`-th selected column was written so far; it tells how its values are rounded.
    pub fn decimals(&self, i: usize) -> u32 {
        self.decimals.get(i).copied().unwrap_or(0)
    }

    /// The next block of rows; `None` at the end of the file.
    ///
    /// # Errors
    /// A ragged row, a field that is not a number or is out of range, text that is not UTF-8, a failed read.
    pub fn next_chunk(&mut self) -> Result<Option<Chunk>, InputError> {
        let rows = self.rows_per_chunk.min(1 << 16);
        let mut chunk =
            Chunk { columns: vec![Vec::with_capacity(rows); self.selected.len()], lines: Vec::with_capacity(rows) };
        let single = self.header.len() == 1;
        let mut blanks = 0;
        while chunk.lines.len() < self.rows_per_chunk && self.next_line()? {
            let line = self.lines.number;
            if self.lines.text.is_empty() {
                blanks += 1;
                continue;
            }
            if single {
                chunk.lines.extend(line - blanks..line);
                chunk.columns.iter_mut().for_each(|c| c.resize(c.len() + blanks as usize, f64::NAN));
            }
            blanks = 0;
            self.row.split(&self.lines.text);
            let (found, expected) = (self.row.ends.len() as u64, self.header.len() as u64);
            if found != expected {
                return Err(InputError::at(&self.file, line, None, InputProblem::RaggedRow { found, expected }));
            }
            chunk.lines.push(line);
            for (k, (&i, column)) in self.selected.iter().zip(&mut chunk.columns).enumerate() {
                let field = self.row.field(&self.lines.text, i);
                let value = parse(field).map_err(|problem| {
                    InputError::at(&self.file, line, self.header.get(i).map(String::as_str), problem)
                })?;
                self.decimals[k] = self.decimals[k].max(decimals(field));
                column.push(value);
            }
        }
        Ok((!chunk.lines.is_empty()).then_some(chunk))
    }

    fn next_line(&mut self) -> Result<bool, InputError> {
        self.lines.advance().map_err(|e| InputError::whole(&self.file, InputProblem::from_io(&e)))
    }

    fn read_header(&mut self) -> Result<(), InputError> {
        loop {
            if !self.next_line()? {
                return Err(InputError::whole(&self.file, InputProblem::Empty));
            }
            if !self.lines.text.is_empty() {
                break;
            }
        }
        let line = self.lines.number;
        self.row.split(&self.lines.text);
        let at = |column: Option<&str>, problem| InputError::at(&self.file, line, column, problem);
        let names = (0..self.row.ends.len())
            .map(|i| std::str::from_utf8(self.row.field(&self.lines.text, i)).map(|name| name.trim().to_owned()))
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
        self.header = names;
        Ok(())
    }

    fn index_of(&self, name: &str) -> Result<usize, InputError> {
        self.header.iter().position(|n| n == name).ok_or_else(|| {
            let has = self.header.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
            InputError::in_column(&self.file, name, InputProblem::MissingColumn(has))
        })
    }
}

/// The lines of a file, one at a time, without their ends, with their numbers.
struct Lines {
    input: BufReader<File>,
    text: Vec<u8>,
    number: u64,
}

impl Lines {
    /// Reads the next line into `text`; `false` at the end of the file.
    fn advance(&mut self) -> std::io::Result<bool> {
        self.text.clear();
        if self.input.read_until(b'\n', &mut self.text)? == 0 {
            return Ok(false);
        }
        self.number += 1;
        while self.text.last().is_some_and(|b| matches!(b, b'\n' | b'\r')) {
            self.text.pop();
        }
        Ok(true)
    }
}

/// Where the fields of one line are: in the line itself, or, where the line has quotes, in an unquoted copy.
#[derive(Default)]
struct Row {
    /// End of each field.
    ends: Vec<usize>,
    unquoted: Option<ByteRecord>,
}

impl Row {
    fn split(&mut self, line: &[u8]) {
        self.ends.clear();
        self.unquoted = None;
        if line.contains(&b'"') {
            let mut record = ByteRecord::new();
            let mut reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(line);
            if reader.read_byte_record(&mut record).unwrap_or(false) {
                self.ends.resize(record.len(), 0);
                self.unquoted = Some(record);
                return;
            }
        }
        self.ends.extend(line.iter().enumerate().filter(|(_, b)| **b == b',').map(|(i, _)| i));
        self.ends.push(line.len());
    }

    /// The `i`-th field of the line that was split last.
    fn field<'a>(&'a self, line: &'a [u8], i: usize) -> &'a [u8] {
        if let Some(record) = &self.unquoted {
            return record.get(i).unwrap_or_default();
        }
        let start = if i == 0 { 0 } else { self.ends.get(i - 1).map_or(line.len(), |e| e + 1) };
        self.ends.get(i).and_then(|&end| line.get(start..end)).unwrap_or_default()
    }
}

fn open(file: &Path) -> Result<File, InputError> {
    let whole = |error: &std::io::Error| InputError::whole(file, InputProblem::from_io(error));
    let input = File::open(file).map_err(|e| whole(&e))?;
    if input.metadata().map_err(|e| whole(&e))?.is_dir() {
        return Err(InputError::whole(file, InputProblem::IsDirectory));
    }
    Ok(input)
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

/// The number in a field; `NaN` for an empty field or one that says `NaN`.
fn parse(field: &[u8]) -> Result<f64, InputProblem> {
    let field = field.trim_ascii();
    if field.is_empty() {
        return Ok(f64::NAN);
    }
    let text = std::str::from_utf8(field).map_err(|_| InputProblem::NotUtf8(""))?;
    match text.parse::<f64>() {
        Ok(value) if value.abs() <= LARGEST_VALUE || value.is_nan() => Ok(value),
        Ok(_) => Err(InputProblem::OutOfRange(excerpt(text))),
        Err(_) if text.contains('\0') => Err(InputProblem::NotUtf8(" (zero bytes: UTF-16 or a binary file)")),
        Err(_) => Err(InputProblem::NotANumber(excerpt(text))),
    }
}

fn excerpt(text: &str) -> String {
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}

/// Decimals of a plain number (`0.00164` has five); numbers with an exponent count as exact.
fn decimals(field: &[u8]) -> u32 {
    let field = field.trim_ascii();
    match field.iter().position(|&b| b == b'.') {
        None => 0,
        Some(point) => {
            let after = &field[point + 1..];
            if after.iter().all(u8::is_ascii_digit) { after.len() as u32 } else { 20 }
        }
    }
}
