//! Tables: quantities in rows, configurations in columns; as aligned text and as HTML.

use super::comparison::Summary;
use super::curve::{Bound, SpeedUp};
use super::ensemble::Interval;
use super::html::escape;

/// A table of text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Titles of the columns, that of the first column first.
    pub header: Vec<String>,
    /// Rows as long as the header.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Aligned lines: the first column to the left, the others to the right.
    pub fn text(&self) -> String {
        let lines = || std::iter::once(&self.header).chain(&self.rows);
        let width = |c: usize| lines().filter_map(|r| r.get(c)).map(|t| t.chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.header.len()).map(width).collect();
        let mut out = String::new();
        for row in lines() {
            let mut line = String::new();
            for (i, cell) in row.iter().enumerate() {
                let space = " ".repeat(widths.get(i).copied().unwrap_or(0).saturating_sub(cell.chars().count()));
                match i {
                    0 => line += &format!("{cell}{space}"),
                    _ => line += &format!("  {space}{cell}"),
                }
            }
            out += line.trim_end();
            out.push('\n');
        }
        out
    }

    /// An HTML table.
    pub fn html(&self) -> String {
        let cells =
            |row: &[String], tag: &str| -> String {
                row.iter()
                    .enumerate()
                    .map(|(i, t)| {
                        if i == 0 { format!("<th>{}</th>", escape(t)) } else { format!("<{tag}>{}</{tag}>", escape(t)) }
                    })
                    .collect()
            };
        let body: String = self.rows.iter().map(|r| format!("<tr>{}</tr>\n", cells(r, "td"))).collect();
        format!("<table><thead><tr>{}</tr></thead>\n<tbody>\n{body}</tbody></table>\n", cells(&self.header, "th"))
    }
}

/// The table of a comparison.
pub fn of_summaries(summaries: &[Summary]) -> Table {
    let mut table = Table { header: vec![String::new()], rows: Vec::new() };
    table.header.extend(summaries.iter().map(|s| s.name.clone()));
    let mut row = |name: &str, value: &dyn Fn(&Summary) -> String| {
        let values: Vec<String> = summaries.iter().map(value).collect();
        // What no configuration has is not worth a line.
        if values.iter().any(|v| v != NOTHING) {
            table.rows.push(std::iter::once(name.to_string()).chain(values).collect());
        }
    };
    row("relMSE, untrimmed", &|s| error(s.relmse.mean));
    row("  spread over runs (sd)", &|s| s.relmse.sd.map_or(NOTHING.into(), error));
    row("  bias squared (se)", &|s| match (s.relmse.bias_sq, s.relmse.bias_sq_error) {
        (Some(b), Some(e)) => format!("{} ({})", error(b), error(e)),
        (Some(b), None) => error(b),
        _ => NOTHING.into(),
    });
    row("  variance", &|s| s.relmse.variance.map_or(NOTHING.into(), error));
    row("relMSE, worst 0.1 % dropped", &|s| error(s.relmse_trimmed));
    row("relMSE of 8x8 blocks", &|s| error(s.blocks));
    row("FLIP", &|s| format!("{:.4}", s.flip));
    row("bias of the mean, % (95 %)", &|s| interval(&s.bias));
    row("  below, % (95 %)", &|s| s.bias.bound.map_or(NOTHING.into(), |b| format!("{b:.3}")));
    row("mean less the first's, % (95 %)", &|s| s.difference.as_ref().map_or(NOTHING.into(), interval));
    row("CPU s", &|s| spread(s.cpu_seconds.mean, s.cpu_seconds.sd));
    row("wall s", &|s| spread(s.wall_seconds.mean, s.wall_seconds.sd));
    row("relMSE x CPU s", &|s| error(s.relmse_seconds));
    row("passes", &|s| count(s.passes));
    row("samples", &|s| count(s.samples));
    row("rays", &|s| count(s.rays));
    row("shadow rays", &|s| count(s.shadow_rays));
    row("photons", &|s| if s.photons > 0.0 { count(s.photons) } else { NOTHING.into() });
    row("speed-up at equal error (95 %)", &|s| s.speed_up.as_ref().map_or(NOTHING.into(), gain));
    row("  read at relMSE", &|s| s.speed_up.as_ref().map_or(NOTHING.into(), |g| error(g.at_relmse)));
    row("fewer photons at equal error (95 %)", &|s| s.photon_gain.as_ref().map_or(NOTHING.into(), gain));
    table
}

/// What stands where there is no number.
pub const NOTHING: &str = "-";

/// An error: three digits.
pub fn error(value: f64) -> String {
    format!("{value:.2e}")
}

/// A count: three digits with K, M or G from ten thousand on.
pub fn count(value: f64) -> String {
    let short = |v: f64, unit: &str| {
        let digits = if v >= 100.0 { 0 } else { 1 + usize::from(v < 10.0) };
        format!("{v:.digits$} {unit}")
    };
    match value {
        v if v >= 1e9 => short(v * 1e-9, "G"),
        v if v >= 1e6 => short(v * 1e-6, "M"),
        v if v >= 1e4 => short(v * 1e-3, "K"),
        v if v.fract() == 0.0 => format!("{v:.0}"),
        v => format!("{v:.1}"),
    }
}

fn spread(mean: f64, sd: Option<f64>) -> String {
    sd.map_or(format!("{mean:.3}"), |sd| format!("{mean:.3} ± {sd:.3}"))
}

fn interval(i: &Interval) -> String {
    i.half_width.map_or(format!("{:+.3}", i.percent), |h| format!("{:+.3} ± {h:.3}", i.percent))
}

/// A factor with its bound and interval.
pub fn gain(s: &SpeedUp) -> String {
    let sign = match s.bound {
        Bound::Exact => "",
        Bound::AtLeast => ">= ",
        Bound::AtMost => "<= ",
    };
    let range = s.interval.map_or(String::new(), |[low, high]| format!(" ({low:.2} - {high:.2})"));
    format!("{sign}{:.2}{range}", s.ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_aligned_and_html_escaped() {
        let table = Table {
            header: vec!["".into(), "a<b".into(), "long name".into()],
            rows: vec![vec!["relMSE".into(), "1".into(), "22".into()], vec!["x".into(), "1.0 ± 2".into(), "-".into()]],
        };
        let lines: Vec<String> = table.text().lines().map(String::from).collect();
        assert_eq!(lines, ["            a<b  long name", "relMSE        1         22", "x       1.0 ± 2          -"]);
        assert!(table.html().contains("<th>a&lt;b</th>") && table.html().contains("<td>22</td>"));
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([count(12.0), count(12.5), count(12_345.0), count(2.5e7)], ["12", "12.5", "12.3 K", "25.0 M"]);
        assert_eq!([count(1_026_100.0), count(598_123.0), count(3.4e9)], ["1.03 M", "598 K", "3.40 G"]);
        let s = SpeedUp { ratio: 4.0, bound: Bound::AtLeast, at_relmse: 0.1, interval: Some([3.0, 5.0]) };
        assert_eq!(gain(&s), ">= 4.00 (3.00 - 5.00)");
    }
}
