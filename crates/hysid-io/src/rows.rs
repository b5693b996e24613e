//! Rows of numbers in a piece of text: the one place where the body of a CSV file is judged.
//!
//! A row in plain form (numbers, nothing or `NaN` between commas, no quotes) is read in one go. Every other row is cut into fields first,
//! with the csv crate where it has quotes; that way reads the plain form too, and all messages come from it.

use std::path::PathBuf;

use csv::ByteRecord;

use crate::error::{InputError, InputProblem};
use crate::number::{decimals, leading, parse};

/// Consecutive rows of the columns that were asked for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chunk {
    /// One vector for each column, in the order asked for; all of the same length. A missing sample is `NaN`.
    pub columns: Vec<Vec<f64>>,
    /// The line (from 1) of each row.
    pub lines: Vec<u64>,
}

/// What the rows of a file look like.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub file: PathBuf,
    pub header: Vec<String>,
    /// The columns wanted, in the order wanted.
    pub selected: Vec<usize>,
    /// For each column of the file its place among those wanted.
    places: Vec<Option<usize>>,
    /// Whether no column is wanted twice, which the quick way cannot serve.
    plain: bool,
}

/// What a piece of text holds.
#[derive(Debug, Clone, Default)]
pub(crate) struct Parsed {
    pub chunk: Chunk,
    /// Bytes read.
    pub bytes: usize,
    /// Lines read.
    pub lines: u64,
    /// Blank lines at the end, which may be missing samples or the end of the file.
    pub blanks: u64,
    /// The largest number of decimals in each column.
    pub decimals: Vec<u32>,
}

impl Layout {
    pub fn new(file: PathBuf, header: Vec<String>, selected: Vec<usize>) -> Self {
        let mut places = vec![None; header.len()];
        let mut plain = true;
        for (place, &i) in selected.iter().enumerate() {
            plain &= places[i].replace(place).is_none();
        }
        Self { file, header, selected, places, plain }
    }

    /// Whether a blank line may be a missing sample.
    pub fn blank_is_row(&self) -> bool {
        self.header.len() == 1
    }

    /// Reads up to `most` rows from `text`, which consists of whole lines; `lines` lines are before it, the last `blanks` of them blank.
    pub fn parse(&self, text: &[u8], most: usize, lines: u64, blanks: u64) -> Result<Parsed, InputError> {
        // A short row has four bytes; more are rarely in one call than the rows asked for.
        let room = most.min(text.len() / (4 * self.header.len()) + 1).min(1 << 16);
        let chunk =
            Chunk { columns: vec![Vec::with_capacity(room); self.selected.len()], lines: Vec::with_capacity(room) };
        let mut out = Parsed { chunk, blanks, decimals: vec![0; self.selected.len()], ..Parsed::default() };
        let mut values = vec![f64::NAN; self.selected.len()];
        let mut fields = Fields::default();
        while out.bytes < text.len() && out.chunk.lines.len() < most {
            let rest = &text[out.bytes..];
            out.lines += 1;
            let line = lines + out.lines;
            if let Some(len) = self.quick(rest, &mut values, &mut out.decimals) {
                out.bytes += len;
            } else {
                let len = rest.iter().position(|&b| b == b'\n').map_or(rest.len(), |n| n + 1);
                out.bytes += len;
                let row = without_end(&rest[..len]);
                if row.is_empty() {
                    out.blanks += 1;
                    continue;
                }
                self.slow(row, line, &mut fields, &mut values, &mut out.decimals)?;
            }
            if self.blank_is_row() {
                out.chunk.missing(line - out.blanks..line);
            }
            out.blanks = 0;
            out.chunk.lines.push(line);
            for (column, value) in out.chunk.columns.iter_mut().zip(&values) {
                column.push(*value);
            }
        }
        Ok(out)
    }

    /// Reads the first row of `text` if it is of the plain form; returns the bytes it takes with its line end.
    #[inline]
    fn quick(&self, text: &[u8], values: &mut [f64], most: &mut [u32]) -> Option<usize> {
        if !self.plain || matches!(text.first(), Some(b'\n' | b'\r')) {
            return None;
        }
        let mut at = 0;
        for (i, place) in self.places.iter().enumerate() {
            match *place {
                Some(place) => {
                    at += text[at..].iter().take_while(|b| **b == b' ').count();
                    match text.get(at) {
                        Some(b',' | b'\n') => values[place] = f64::NAN,
                        _ => {
                            let found = leading(&text[at..])?;
                            at += found.len;
                            values[place] = found.value;
                            most[place] = most[place].max(found.decimals);
                        }
                    }
                }
                None => {
                    let special = text[at..].iter().position(|b| matches!(b, b',' | b'\n' | b'\r' | b'"'));
                    at = special.map_or(text.len(), |n| at + n);
                }
            }
            if i + 1 < self.places.len() {
                if text.get(at) != Some(&b',') {
                    return None;
                }
                at += 1;
            }
        }
        match text[at..] {
            [] => Some(at),
            [b'\n', ..] => Some(at + 1),
            [b'\r', b'\n', ..] => Some(at + 2),
            _ => None,
        }
    }

    /// Reads one row without its line end.
    fn slow(
        &self,
        row: &[u8],
        line: u64,
        fields: &mut Fields,
        values: &mut [f64],
        most: &mut [u32],
    ) -> Result<(), InputError> {
        fields.split(row);
        let (found, expected) = (fields.len() as u64, self.header.len() as u64);
        if found != expected {
            return Err(InputError::at(&self.file, line, None, InputProblem::RaggedRow { found, expected }));
        }
        for (place, &i) in self.selected.iter().enumerate() {
            let field = fields.get(row, i);
            values[place] = parse(field)
                .map_err(|problem| InputError::at(&self.file, line, self.header.get(i).map(String::as_str), problem))?;
            most[place] = most[place].max(decimals(field));
        }
        Ok(())
    }
}

impl Chunk {
    /// Adds the rows of another chunk of the same columns.
    pub(crate) fn append(&mut self, more: Self) {
        if self.lines.is_empty() {
            *self = more;
            return;
        }
        self.lines.extend(more.lines);
        for (column, new) in self.columns.iter_mut().zip(more.columns) {
            column.extend(new);
        }
    }

    /// Adds rows in which everything is missing.
    fn missing(&mut self, lines: std::ops::Range<u64>) {
        self.lines.extend(lines);
        self.columns.iter_mut().for_each(|c| c.resize(self.lines.len(), f64::NAN));
    }

    /// Puts rows in which everything is missing in front.
    pub(crate) fn missing_before(&mut self, lines: std::ops::Range<u64>) {
        let count = (lines.end - lines.start) as usize;
        self.lines.splice(0..0, lines);
        for column in &mut self.columns {
            column.splice(0..0, std::iter::repeat_n(f64::NAN, count));
        }
    }
}

/// A line without the bytes that end it.
pub(crate) fn without_end(mut line: &[u8]) -> &[u8] {
    while let [rest @ .., b'\n' | b'\r'] = line {
        line = rest;
    }
    line
}

/// Where the fields of one line are: in the line itself, or, where the line has quotes, in an unquoted copy.
#[derive(Default)]
pub(crate) struct Fields {
    /// End of each field.
    ends: Vec<usize>,
    unquoted: Option<ByteRecord>,
}

impl Fields {
    pub fn split(&mut self, line: &[u8]) {
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

    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// The `i`-th field of the line that was split last.
    pub fn get<'a>(&'a self, line: &'a [u8], i: usize) -> &'a [u8] {
        if let Some(record) = &self.unquoted {
            return record.get(i).unwrap_or_default();
        }
        let start = if i == 0 { 0 } else { self.ends.get(i - 1).map_or(line.len(), |e| e + 1) };
        self.ends.get(i).and_then(|&end| line.get(start..end)).unwrap_or_default()
    }
}
