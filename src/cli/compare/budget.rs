//! How long each run goes on: CPU time, passes or photons.

use crate::cli::options;
use crate::report::table::count;
use std::time::Duration;

/// What is equal among the runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Equal {
    /// CPU time of all threads, preparation included.
    Time,
    /// Passes.
    Passes,
    /// Emitted photons.
    Photons,
}

/// How much a run may spend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// CPU time.
    Time(Duration),
    /// Passes.
    Passes(u64),
    /// Photons; the pass that reaches the number is completed.
    Photons(u64),
}

impl Budget {
    /// Reads a budget in the unit of `equal`; the default without text.
    pub fn parse(equal: Equal, text: Option<&str>) -> Result<Budget, String> {
        let wrong = |what: &str, e: String| format!("--budget {}: {e}; expected {what}", text.unwrap_or_default());
        match equal {
            Equal::Time => {
                let limit = options::duration(text.unwrap_or("10s"))
                    .map_err(|e| wrong("CPU time such as 10s, as --equal time has it", e))?;
                if limit.is_zero() { Err("--budget: must be above 0".into()) } else { Ok(Budget::Time(limit)) }
            }
            Equal::Passes => options::positive(text.unwrap_or("64"))
                .map(Budget::Passes)
                .map_err(|e| wrong("a number of passes, as --equal passes has it", e)),
            Equal::Photons => options::positive(text.unwrap_or("1M"))
                .map(Budget::Photons)
                .map_err(|e| wrong("a number of photons such as 500K, as --equal photons has it", e)),
        }
    }

    /// A budget of a reference: CPU time with a unit (`60s`), or passes (`256`).
    pub fn of_reference(text: &str) -> Result<Budget, String> {
        let passes = options::positive(text);
        if let Ok(n) = passes {
            return Ok(Budget::Passes(n));
        }
        match options::duration(text) {
            Ok(limit) if !limit.is_zero() => Ok(Budget::Time(limit)),
            _ => Err("expected CPU time with its unit, such as 60s, or a number of passes".into()),
        }
    }

    /// What a reference of each half gets if nothing is said: enough that its noise is well below that of the runs.
    pub fn for_half_a_reference(self) -> Budget {
        match self {
            Budget::Time(limit) => Budget::Time(limit.saturating_mul(4)),
            Budget::Passes(n) => Budget::Passes(n.saturating_mul(8)),
            Budget::Photons(_) => Budget::Time(Duration::from_secs(30)),
        }
    }

    /// The budget in words.
    pub fn text(self) -> String {
        match self {
            Budget::Time(limit) => format!("{} CPU s", limit.as_secs_f64()),
            Budget::Passes(n) => format!("{n} passes"),
            Budget::Photons(n) => format!("{} photons", count(n as f64)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_have_the_unit_of_what_is_equal() {
        assert_eq!(Budget::parse(Equal::Time, Some("500ms")), Ok(Budget::Time(Duration::from_millis(500))));
        assert_eq!(Budget::parse(Equal::Passes, Some("1K")), Ok(Budget::Passes(1000)));
        assert_eq!(Budget::parse(Equal::Photons, None), Ok(Budget::Photons(1_000_000)));
        for (equal, bad) in [(Equal::Time, "0s"), (Equal::Time, "5x"), (Equal::Passes, "0"), (Equal::Photons, "10s")] {
            let message = Budget::parse(equal, Some(bad)).unwrap_err();
            assert!(message.contains("--budget"), "{message}");
        }
        assert_eq!(Budget::of_reference("2min"), Ok(Budget::Time(Duration::from_secs(120))));
        assert_eq!(Budget::of_reference("64"), Ok(Budget::Passes(64)));
        assert!(["", "0", "0s", "x"].iter().all(|t| Budget::of_reference(t).is_err()));
        assert_eq!(Budget::Photons(250_000).text(), "250 K photons");
    }
}
