//! The `dualux` program: see [`dualux::cli`].

fn main() -> std::process::ExitCode {
    dualux::cli::main(std::time::Instant::now())
}
