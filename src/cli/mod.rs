//! The command line: one file per subcommand.
//!
//! Results go to stdout, progress and messages to stderr. Exit code 0; 1 for a scene or run-time error; 2 for a wrong
//! command line.

mod checks;
mod compare;
mod debug_files;
mod edges;
mod flags;
mod info;
mod load;
mod metric;
mod options;
mod output;
mod progress;
mod render;
mod reproduce;
mod session;

use clap::{CommandFactory, Parser, Subcommand};
use std::error::Error;
use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;
use std::time::Instant;

/// What a subcommand can fail with; its text is for the user.
type Failure = Box<dyn Error + Send + Sync>;

/// CPU global illumination renderer.
#[derive(Debug, Parser)]
#[command(name = "dualux", version, about, long_about = None, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Render a scene to EXR or PNG.
    Render(Box<render::RenderArgs>),
    /// Say what a scene holds: shapes, triangles, lights and their power, warnings, and which integrator will run.
    Info(info::InfoArgs),
    /// Draw and score the map of edges that derivatives predict.
    Edges(edges::EdgesArgs),
    /// Compare configurations of one scene at equal time, passes or photons, and write a report.
    Compare(Box<compare::CompareArgs>),
    /// Compare an image with a reference.
    Metric(metric::MetricArgs),
    /// Run a paper's comparisons again and print its figures beside ours.
    Reproduce(Box<reproduce::ReproduceArgs>),
    /// Print a completion script for a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

/// Runs the program. `start` is when the process began; time limits count from there.
pub fn main(start: Instant) -> ExitCode {
    // A wrong command line ends here with exit code 2.
    let cli = Cli::parse();
    let result = match &cli.command {
        Command::Render(args) => render::run(args, start),
        Command::Info(args) => info::run(args),
        Command::Edges(args) => edges::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Metric(args) => metric::run(args),
        Command::Reproduce(args) => reproduce::run(args),
        Command::Completions { shell } => {
            // Into memory first: the generator panics where its output cannot be written.
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "dualux", &mut script);
            print(&script)
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            tell(output::error_text(e.as_ref()));
            ExitCode::FAILURE
        }
    }
}

/// Writes a result to stdout. A reader that has gone away (`| head`) has read enough.
fn print(text: impl AsRef<[u8]>) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_ref()).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(format!("standard output: {e}").into()),
        _ => Ok(()),
    }
}

/// Writes a line to stderr. If that fails there is nobody left to tell, and it must not end a render.
fn tell(line: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
