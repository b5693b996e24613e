//! A CSV file as a stream of blocks of numbers, for files of any size.
//!
//! The header, the shape of each row and each number are judged here; the clock is judged by [`crate::fit_clock`], which needs the
//! whole time column. A blank line is skipped, except in a file of one column, where it is a missing sample unless it ends the file.
//! A line is a row: a line end within quotes is not understood.

use std::path::Path;

use crate::error::InputError;
use crate::rows::{Chunk, Layout};
use crate::text::{Blocks, Source, start};

/// Reads a CSV file block by block.
#[derive(Debug)]
pub struct CsvChunks {
    blocks: Blocks,
    layout: Layout,
    rows_per_chunk: usize,
    decimals: Vec<u32>,
    /// The block of text being read, and how far it is read.
    text: Vec<u8>,
    at: usize,
    /// Lines read, and how many of the last ones were blank.
    lines: u64,
    blanks: u64,
}

impl CsvChunks {
    /// Opens the file and reads its header; `select` names the columns to parse (`None`: all of them), in the order wanted.
    ///
    /// # Errors
    /// Whatever is wrong with the file or its header: see [`crate::InputProblem`].
    pub fn open(file: &Path, select: Option<&[&str]>, rows_per_chunk: usize) -> Result<Self, InputError> {
        let Source { blocks, layout, text, at, lines } = start(file, select)?;
        let decimals = vec![0; layout.selected.len()];
        Ok(Self { blocks, layout, rows_per_chunk: rows_per_chunk.max(1), decimals, text, at, lines, blanks: 0 })
    }

    /// The names of all columns, in the order of the file.
    pub fn header(&self) -> &[String] {
        &self.layout.header
    }

    /// The names of the columns that each [`Chunk`] holds.
    pub fn selected(&self) -> impl Iterator<Item = &str> {
        self.layout.selected.iter().filter_map(|&i| self.layout.header.get(i)).map(String::as_str)
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
        let mut chunk = Chunk { columns: vec![Vec::new(); self.layout.selected.len()], lines: Vec::new() };
        while chunk.lines.len() < self.rows_per_chunk {
            if self.at == self.text.len() {
                self.text = self.blocks.next_block()?;
                self.at = 0;
                if self.text.is_empty() {
                    break;
                }
            }
            let wanted = self.rows_per_chunk - chunk.lines.len();
            let parsed = self.layout.parse(&self.text[self.at..], wanted, self.lines, self.blanks)?;
            self.at += parsed.bytes;
            self.lines += parsed.lines;
            self.blanks = parsed.blanks;
            for (all, new) in self.decimals.iter_mut().zip(&parsed.decimals) {
                *all = (*all).max(*new);
            }
            chunk.append(parsed.chunk);
        }
        Ok((!chunk.lines.is_empty()).then_some(chunk))
    }
}
