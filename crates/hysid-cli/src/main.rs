//! The command line `hysid`: data on stdout, messages on stderr.

fn main() {}
