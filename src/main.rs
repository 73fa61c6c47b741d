//! The `dualux` program: see [`dualux::cli`].

fn main() {}
