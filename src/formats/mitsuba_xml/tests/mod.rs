//! Tests of the reader.

mod public;
