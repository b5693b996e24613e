//! Files: recordings as CSV with errors that name file, line and column; versioned model files; write, then rename.
