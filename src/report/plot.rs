//! Log-log plots as SVG within a page.
//!
//! Colours are presentation attributes with a class beside them, so that the page's style sheet can replace them for a
//! dark background. Series differ by marker as well as by colour.

use super::html::escape;
use std::fmt::Write as _;

/// A line of a plot.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Name, for the legend.
    pub name: String,
    /// Points (x, y), all positive.
    pub points: Vec<(f64, f64)>,
    /// Single runs, drawn faintly.
    pub runs: Vec<Vec<(f64, f64)>>,
}

/// A plot with logarithmic axes.
#[derive(Clone, Debug, Default)]
pub struct LogLog {
    /// Label of the horizontal axis.
    pub x_label: String,
    /// Label of the vertical axis.
    pub y_label: String,
    /// The lines.
    pub series: Vec<Series>,
    /// Whether a dotted line y ~ 1/x is drawn for comparison: the rate of plain Monte Carlo.
    pub guide: bool,
}

/// Colours of the series (Okabe & Ito, told apart by colour-blind eyes), also class `c0` to `c6` of the style sheet.
pub const COLORS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#b8860b", "#555555"];

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 420.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 50.0;

/// One logarithmic axis: values from `low` to `high` onto `from` to `to`.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    /// An axis that holds all values with a little room, over at least a factor of 2.
    fn new(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Axis {
        let (mut low, mut high) = values.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        if low > high {
            (low, high) = (0.1, 10.0);
        }
        let room = (0.06 * (high / low).ln()).max(0.5 * (2.0 / (high / low)).ln()).max(0.05).exp();
        Axis { low: low / room, high: high * room, from, to }
    }

    fn at(&self, v: f64) -> f64 {
        self.from + (self.to - self.from) * (v / self.low).ln() / (self.high / self.low).ln()
    }

    /// Grid values (value, labelled): 1 to 9 times powers of ten, labels as many as there is room for.
    fn ticks(&self) -> Vec<(f64, bool)> {
        let decades = (self.high / self.low).log10();
        let labelled = |m: i32, e: i32| match decades {
            d if d > 6.0 => m == 1 && e % 2 == 0,
            d if d > 2.0 => m == 1,
            d if d > 0.8 => matches!(m, 1 | 2 | 5),
            _ => true,
        };
        let exponents = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        exponents
            .flat_map(|e| (1..10).map(move |m| (f64::from(m) * 10f64.powi(e), labelled(m, e))))
            .filter(|&(v, labelled)| v >= self.low && v <= self.high && (decades <= 4.0 || labelled))
            .collect()
    }
}

/// A tick's label: plain from 0.001 to 10,000, else with a power of ten.
fn label(v: f64) -> String {
    let e = v.log10().floor();
    let e = if 10f64.powf(e + 1.0) <= v * (1.0 + 1e-9) { e + 1.0 } else { e } as i32;
    let m = (v / 10f64.powi(e)).round() as i32;
    if (-2..=4).contains(&e) {
        return if e >= 0 { format!("{v:.0}") } else { format!("{v:.*}", -e as usize) };
    }
    let digit = |c: char| match c {
        '-' => '⁻',
        _ => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][c.to_digit(10).unwrap_or(0) as usize],
    };
    let power: String = e.to_string().chars().map(digit).collect();
    if m == 1 { format!("10{power}") } else { format!("{m}·10{power}") }
}

impl LogLog {
    /// The plot as an `svg` element.
    pub fn svg(&self) -> String {
        let all = || self.series.iter().flat_map(|s| s.points.iter().chain(s.runs.iter().flatten()));
        let x = Axis::new(all().map(|p| p.0), LEFT, WIDTH - RIGHT);
        let y = Axis::new(all().map(|p| p.1), HEIGHT - BOTTOM, TOP);
        let mut s = format!(
            "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{} against {}\" \
             font-family=\"system-ui, sans-serif\" font-size=\"13\">\n",
            escape(&self.y_label),
            escape(&self.x_label)
        );
        // Writing to a string cannot fail.
        self.frame(&mut s, &x, &y);
        if self.guide {
            self.draw_guide(&mut s, &x, &y);
        }
        for (i, series) in self.series.iter().enumerate() {
            let (class, color) = (i % COLORS.len(), COLORS[i % COLORS.len()]);
            for run in &series.runs {
                let _ = writeln!(
                    s,
                    "<path class=\"c{class}\" d=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1\" stroke-opacity=\"0.25\"/>",
                    path(run, &x, &y)
                );
            }
            let _ = writeln!(
                s,
                "<path class=\"c{class}\" d=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" stroke-linejoin=\"round\"/>",
                path(&series.points, &x, &y)
            );
            series.points.iter().for_each(|&(px, py)| s += &marker(i, x.at(px), y.at(py)));
        }
        self.legend(&mut s);
        s + "</svg>\n"
    }

    fn frame(&self, s: &mut String, x: &Axis, y: &Axis) {
        let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
        for (v, labelled) in x.ticks() {
            let at = x.at(v);
            let opacity = if labelled { 0.25 } else { 0.1 };
            let _ = writeln!(
                s,
                "<line class=\"grid\" x1=\"{at:.1}\" y1=\"{TOP}\" x2=\"{at:.1}\" y2=\"{bottom}\" stroke=\"#777\" stroke-opacity=\"{opacity}\"/>"
            );
            if labelled {
                let _ = writeln!(
                    s,
                    "<text class=\"ink\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#333\">{}</text>",
                    bottom + 18.0,
                    label(v)
                );
            }
        }
        for (v, labelled) in y.ticks() {
            let at = y.at(v);
            let opacity = if labelled { 0.25 } else { 0.1 };
            let _ = writeln!(
                s,
                "<line class=\"grid\" x1=\"{LEFT}\" y1=\"{at:.1}\" x2=\"{right}\" y2=\"{at:.1}\" stroke=\"#777\" stroke-opacity=\"{opacity}\"/>"
            );
            if labelled {
                let _ = writeln!(
                    s,
                    "<text class=\"ink\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#333\">{}</text>",
                    LEFT - 8.0,
                    at + 4.5,
                    label(v)
                );
            }
        }
        let _ = writeln!(
            s,
            "<rect class=\"frame\" x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#777\"/>\n\
             <text class=\"ink\" x=\"{}\" y=\"{}\" text-anchor=\"middle\" fill=\"#333\">{}</text>\n\
             <text class=\"ink\" x=\"0\" y=\"0\" transform=\"translate(18 {}) rotate(-90)\" text-anchor=\"middle\" fill=\"#333\">{}</text>",
            right - LEFT,
            bottom - TOP,
            0.5 * (LEFT + right),
            HEIGHT - 8.0,
            escape(&self.x_label),
            0.5 * (TOP + bottom),
            escape(&self.y_label)
        );
    }

    /// The line y ~ 1/x through the first point of the first series, within the frame.
    fn draw_guide(&self, s: &mut String, x: &Axis, y: &Axis) {
        let Some(&(px, py)) = self.series.iter().find_map(|s| s.points.first()) else { return };
        let c = px * py;
        let (from, to) = (x.low.max(c / y.high), x.high.min(c / y.low));
        if from < to {
            let _ = writeln!(
                s,
                "<path class=\"guide\" d=\"{}\" fill=\"none\" stroke=\"#777\" stroke-dasharray=\"2 4\"/>",
                path(&[(from, c / from), (to, c / to)], x, y)
            );
        }
    }

    fn legend(&self, s: &mut String) {
        let entries = self.series.len() + usize::from(self.guide);
        let longest = self.series.iter().map(|s| s.name.chars().count()).max().unwrap_or(0).max(12) as f64;
        let (w, h) = (44.0 + 7.3 * longest, 20.0 * entries as f64 + 10.0);
        let (left, top) = (WIDTH - RIGHT - w - 8.0, TOP + 8.0);
        let _ = writeln!(
            s,
            "<rect class=\"legend\" x=\"{left:.1}\" y=\"{top}\" width=\"{w:.1}\" height=\"{h}\" rx=\"4\" fill=\"#fff\" fill-opacity=\"0.85\"/>"
        );
        for i in 0..entries {
            let at = top + 19.0 + 20.0 * i as f64;
            let line = format!("M{:.1} {:.1}h26", left + 6.0, at - 4.5);
            let name = match self.series.get(i) {
                Some(series) => {
                    let (class, color) = (i % COLORS.len(), COLORS[i % COLORS.len()]);
                    let _ = writeln!(
                        s,
                        "<path class=\"c{class}\" d=\"{line}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>{}",
                        marker(i, left + 19.0, at - 4.5)
                    );
                    series.name.as_str()
                }
                None => {
                    let _ = writeln!(
                        s,
                        "<path class=\"guide\" d=\"{line}\" fill=\"none\" stroke=\"#777\" stroke-dasharray=\"2 4\"/>"
                    );
                    "falls as 1/x"
                }
            };
            let _ = writeln!(
                s,
                "<text class=\"ink\" x=\"{:.1}\" y=\"{at:.1}\" fill=\"#333\">{}</text>",
                left + 38.0,
                escape(name)
            );
        }
    }
}

fn path(points: &[(f64, f64)], x: &Axis, y: &Axis) -> String {
    let step = |(i, &(px, py)): (usize, &(f64, f64))| {
        format!("{}{:.1} {:.1}", if i == 0 { 'M' } else { 'L' }, x.at(px), y.at(py))
    };
    points.iter().enumerate().map(step).collect()
}

/// The marker of series `i`: circle, square, triangle, diamond, and so on from the start.
fn marker(i: usize, x: f64, y: f64) -> String {
    let (class, color) = (i % COLORS.len(), COLORS[i % COLORS.len()]);
    let shape = match i % 4 {
        0 => format!("M{:.1} {y:.1}a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z", x - 4.0),
        1 => format!("M{:.1} {:.1}h7v7h-7z", x - 3.5, y - 3.5),
        2 => format!("M{x:.1} {:.1}l4.5 8h-9z", y - 5.0),
        _ => format!("M{x:.1} {:.1}l4.5 5l-4.5 5l-4.5 -5z", y - 5.0),
    };
    format!("<path class=\"m{class}\" d=\"{shape}\" fill=\"{color}\"/>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> LogLog {
        let line = |c: f64| (0..6).map(|i| (f64::from(1 << i), c / f64::from(1 << i))).collect::<Vec<_>>();
        LogLog {
            x_label: "CPU seconds".into(),
            y_label: "relMSE".into(),
            series: vec![
                Series { name: "a & b".into(), points: line(0.1), runs: vec![line(0.12)] },
                Series { name: "c".into(), points: line(0.01), runs: vec![] },
            ],
            guide: true,
        }
    }

    /// Points of the path elements of a class with stroke width 2.
    fn curve(svg: &str, class: &str) -> Vec<(f64, f64)> {
        let doc = roxmltree::Document::parse(svg).expect("well-formed");
        let node = doc
            .descendants()
            .find(|n| n.attribute("class") == Some(class) && n.attribute("stroke-linejoin").is_some())
            .expect("a curve");
        let numbers = node.attribute("d").unwrap().replace(['M', 'L'], ",");
        let pair = |t: &str| t.split_once(' ').map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap())).unwrap();
        numbers.split(',').filter(|t| !t.is_empty()).map(pair).collect()
    }

    #[test]
    fn powers_are_straight_lines_within_the_frame() {
        let svg = plot().svg();
        for class in ["c0", "c1"] {
            let points = curve(&svg, class);
            assert_eq!(points.len(), 6);
            for w in points.windows(3) {
                let (dx, dy) = (w[1].0 - w[0].0, w[1].1 - w[0].1);
                assert!(dx > 0.0 && dy > 0.0, "to the right and down");
                assert!((w[2].0 - w[1].0 - dx).abs() < 0.25 && (w[2].1 - w[1].1 - dy).abs() < 0.25);
            }
            let inside =
                |&(x, y): &(f64, f64)| (LEFT..=WIDTH - RIGHT).contains(&x) && (TOP..=HEIGHT - BOTTOM).contains(&y);
            assert!(points.iter().all(inside));
        }
        assert!(svg.contains("a &amp; b") && !svg.contains("NaN") && !svg.contains("http"));
    }

    #[test]
    fn labels_read_well() {
        let labels = [1e-5, 2e-3, 0.001, 0.05, 0.1, 1.0, 20.0, 10_000.0, 3e6].map(label);
        assert_eq!(labels, ["10⁻⁵", "2·10⁻³", "10⁻³", "0.05", "0.1", "1", "20", "10000", "3·10⁶"]);
        for (low, high) in [(1.0, 1.1), (1e-9, 1e9), (0.3, 7.0), (2.0, 2.0)] {
            let axis = Axis::new([low, high].into_iter(), 0.0, 100.0);
            let ticks = axis.ticks();
            let labelled = ticks.iter().filter(|t| t.1).count();
            assert!((1..=14).contains(&labelled), "{low} {high}: {ticks:?}");
            assert!(ticks.iter().all(|t| (0.0..=100.0).contains(&axis.at(t.0))));
        }
    }

    #[test]
    fn an_empty_plot_is_still_a_plot() {
        let svg = LogLog { guide: true, ..LogLog::default() }.svg();
        assert!(roxmltree::Document::parse(&svg).is_ok() && !svg.contains("NaN") && !svg.contains("inf"));
    }
}
