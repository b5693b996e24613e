//! A CSV file of any size as a stream of numbers, read ahead by a thread of its own and parsed by as many as there are.
//!
//! It gives the rows of [`CsvChunks`](crate::CsvChunks) and stops with the same error; blocks are of text, not of a number of rows. Memory is
//! that of a few blocks of a mebibyte. Blocks are parsed independently of each other and joined in the order of the file, so that neither rows nor errors
//! depend on the number of threads.

use std::path::Path;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;

use rayon::prelude::*;

use crate::error::InputError;
use crate::rows::{Chunk, Layout, Parsed};
use crate::text::{Blocks, Source, start};

/// Blocks that are parsed at a time.
const TOGETHER: usize = 8;

/// Reads a CSV file in blocks, on threads.
#[derive(Debug)]
pub struct CsvStream {
    layout: Layout,
    blocks: Receiver<Result<Vec<u8>, InputError>>,
    lines: u64,
    blanks: u64,
    bytes: u64,
    decimals: Vec<u32>,
    ended: bool,
}

impl CsvStream {
    /// Opens the file and reads its header; `select` names the columns to parse (`None`: all of them), in the order wanted.
    ///
    /// # Errors
    /// As [`CsvChunks::open`](crate::CsvChunks::open).
    pub fn open(file: &Path, select: Option<&[&str]>) -> Result<Self, InputError> {
        let Source { blocks, layout, text, at, lines } = start(file, select)?;
        let (sender, receiver) = sync_channel(TOGETHER);
        let (bytes, decimals) = (at as u64, vec![0; layout.selected.len()]);
        // Without a thread to read ahead the file cannot be streamed; it ends when the receiver is gone.
        let _reader = thread::spawn(move || read_ahead(blocks, text, at, |block| sender.send(block).is_ok()));
        Ok(Self { layout, blocks: receiver, lines, blanks: 0, bytes, decimals, ended: false })
    }

    /// The names of all columns, in the order of the file.
    pub fn header(&self) -> &[String] {
        &self.layout.header
    }

    /// The largest number of decimals with which the `i`-th selected column was written so far.
    pub fn decimals(&self, i: usize) -> u32 {
        self.decimals.get(i).copied().unwrap_or(0)
    }

    /// Bytes of text read so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The next blocks of rows, in order; none at the end of the file.
    ///
    /// # Errors
    /// As [`CsvChunks::next_chunk`](crate::CsvChunks::next_chunk); the first row at fault is told.
    pub fn next_chunks(&mut self) -> Result<Vec<Chunk>, InputError> {
        let mut chunks = Vec::with_capacity(TOGETHER);
        while chunks.is_empty() && !self.ended {
            let mut texts: Vec<Result<Vec<u8>, InputError>> = Vec::with_capacity(TOGETHER);
            while texts.len() < TOGETHER && !self.ended {
                match self.blocks.recv() {
                    Ok(text) => {
                        self.ended = text.is_err();
                        texts.push(text);
                    }
                    Err(_) => self.ended = true,
                }
            }
            let one = |text: Result<Vec<u8>, InputError>| text.and_then(|t| self.layout.parse(&t, usize::MAX, 0, 0));
            let parsed: Vec<Result<Parsed, InputError>> = texts.into_par_iter().map(one).collect();
            for parsed in parsed {
                chunks.extend(self.place(parsed)?);
            }
        }
        Ok(chunks)
    }

    /// Gives the rows of a block (or its error) their lines in the file.
    fn place(&mut self, parsed: Result<Parsed, InputError>) -> Result<Option<Chunk>, InputError> {
        let before = self.lines;
        let Parsed { mut chunk, bytes, lines, blanks, decimals } = parsed.map_err(|mut e| {
            self.ended = true;
            e.line = e.line.map(|line| line + before);
            e
        })?;
        for (all, new) in self.decimals.iter_mut().zip(decimals) {
            *all = (*all).max(new);
        }
        self.bytes += bytes as u64;
        self.lines += lines;
        if chunk.lines.is_empty() {
            self.blanks += blanks;
            return Ok(None);
        }
        chunk.lines.iter_mut().for_each(|line| *line += before);
        if self.layout.blank_is_row() && self.blanks > 0 {
            chunk.missing_before(before + 1 - self.blanks..before + 1);
        }
        self.blanks = blanks;
        Ok(Some(chunk))
    }
}

/// Hands the blocks of a file on, the first one from `at` on, until there are no more or nobody wants them.
fn read_ahead(
    mut blocks: Blocks,
    mut text: Vec<u8>,
    at: usize,
    mut hand_on: impl FnMut(Result<Vec<u8>, InputError>) -> bool,
) {
    text.drain(..at);
    if !text.is_empty() && !hand_on(Ok(text)) {
        return;
    }
    loop {
        let block = blocks.next_block();
        let more = matches!(&block, Ok(text) if !text.is_empty());
        if matches!(&block, Ok(text) if text.is_empty()) || !hand_on(block) || !more {
            return;
        }
    }
}
