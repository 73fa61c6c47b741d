//! The page of a comparison: one file without network access, readable in light and dark.
//!
//! Every picture is embedded once, as the background of a class, and shown by the viewer, the crops and the overviews. The page
//! is well-formed XML too, so that tests can read it.

use super::comparison::{Comparison, Summary};
use super::curve::{Bound, Point, drawable};
use super::picture::{Embedded, FalseColor, crops, density_map, error_map};
use super::plot::{LogLog, Series};
use super::table::{Table, error, of_summaries};
use crate::image::diff;
use crate::math::Rgb;
use std::fmt::Write as _;

/// Number of crops.
const CROPS: usize = 4;
/// Width at which a crop is shown, CSS pixels.
const CROP_WIDTH: usize = 200;
/// Relative bias shown in full colour.
const BIAS_SCALE: f32 = 0.2;

/// The text with what HTML means something by replaced.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The page.
pub fn page(comparison: &Comparison, summaries: &[Summary]) -> String {
    let c = comparison;
    let pictures = pictures(c);
    let mut s = String::from("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n");
    // Writing to a string cannot fail.
    let _ = write!(
        s,
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>{title}</title>\n\
         <style>\n{css}",
        title = escape(&format!("dualux compare: {}", c.scene)),
        css = include_str!("page.css"),
    );
    for (i, (_, picture)) in pictures.iter().enumerate() {
        let _ = writeln!(s, ".p{i} {{ background-image: url({}); }}", picture.address);
    }
    let _ = write!(
        s,
        "</style>\n</head>\n<body>\n<h1>{}</h1>\n<p class=\"soft\">{} x {} pixels, {}. Reference: {}.</p>\n{}",
        escape(&c.scene),
        c.reference.width,
        c.reference.height,
        escape(&c.equal),
        escape(&c.reference_text),
        verdict(summaries),
    );
    let _ = write!(s, "<div class=\"scroll\">{}</div>\n{}", of_summaries(summaries).html(), notes(c, summaries));
    s += &curves(summaries);
    s += &viewer(&pictures, c);
    s += &crop_grid(&pictures, c);
    s += &maps(c);
    let _ = write!(s, "{}<script>\n{}</script>\n</body>\n</html>\n", method(c), include_str!("page.js"));
    s
}

/// A page of tables and plots (SVG) with their titles.
pub fn summary(title: &str, tables: &[(String, Table)], plots: &[(String, String)]) -> String {
    let mut s = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>{0}</title>\n\
         <style>\n{1}</style>\n</head>\n<body>\n<h1>{0}</h1>\n",
        escape(title),
        include_str!("page.css")
    );
    for (title, table) in tables {
        s += &format!("<h2>{}</h2>\n<div class=\"scroll\">{}</div>\n", escape(title), table.html());
    }
    for pair in plots.chunks(2) {
        s += "<div class=\"row\">\n";
        for (title, svg) in pair {
            s += &format!(
                "<figure style=\"flex: 1 1 28rem\"><figcaption>{}</figcaption>{svg}</figure>\n",
                escape(title)
            );
        }
        s += "</div>\n";
    }
    s + "</body>\n</html>\n"
}

/// The reference and the first run of each configuration.
fn pictures(c: &Comparison) -> Vec<(String, Embedded)> {
    let (w, h) = (c.reference.width, c.reference.height);
    let first = |p: &[Rgb]| Embedded::of_pixels(w, h, p, c.exposure);
    let reference = first(&c.reference.mean).map(|p| ("reference".to_string(), p));
    let others = c.configurations.iter().filter_map(|k| Some((k.name.clone(), first(&k.runs.first()?.picture)?)));
    reference.into_iter().chain(others).collect()
}

/// One sentence per configuration beside the baseline.
fn verdict(summaries: &[Summary]) -> String {
    let Some(base) = summaries.first() else { return String::new() };
    let sentence = |s: &Summary| {
        let gain_at = s.speed_up.as_ref()?;
        let sign = match gain_at.bound {
            Bound::Exact => "",
            Bound::AtLeast => "at least ",
            Bound::AtMost => "at most ",
        };
        let range = gain_at.interval.map_or(String::new(), |[low, high]| format!(", 95 %: {low:.2} to {high:.2}"));
        Some(format!(
            "<p><b>{}</b> is <b>{sign}{:.2} times</b> as fast as {} at equal error (relMSE {}{range}).</p>\n",
            escape(&s.name),
            gain_at.ratio,
            escape(&base.name),
            error(gain_at.at_relmse)
        ))
    };
    summaries.iter().skip(1).filter_map(sentence).collect()
}

fn notes(c: &Comparison, summaries: &[Summary]) -> String {
    let mut items: Vec<String> = c.notes.iter().map(|n| escape(n)).collect();
    for s in summaries {
        items.extend(s.remarks.iter().map(|r| format!("{}: {}", escape(&s.name), escape(r))));
    }
    let list: String = items.iter().map(|i| format!("<li>{i}</li>\n")).collect();
    if list.is_empty() { list } else { format!("<ul>\n{list}</ul>\n") }
}

fn curves(summaries: &[Summary]) -> String {
    let plot = |x_label: &str, x: fn(&Point) -> f64| {
        let series: Vec<Series> = summaries
            .iter()
            .map(|s| Series {
                name: s.name.clone(),
                points: drawable(&s.curve, x),
                runs: s.runs.iter().map(|r| drawable(&r.points, x)).collect(),
            })
            .collect();
        LogLog { x_label: x_label.into(), y_label: "relMSE, untrimmed".into(), series, guide: true }.svg()
    };
    let mut s = format!(
        "<h2>Error against time</h2>\n<div class=\"row\">\n<figure style=\"flex: 1 1 28rem\">{}<figcaption>Mean over the runs; \
         single runs faint. CPU seconds of all threads, preparation included.</figcaption></figure>\n",
        plot("CPU seconds", |p| p.cpu_seconds)
    );
    if summaries.iter().any(|s| s.photons > 0.0) {
        let _ = writeln!(
            s,
            "<figure style=\"flex: 1 1 28rem\">{}<figcaption>The same against emitted photons.</figcaption></figure>",
            plot("photons emitted", |p| p.photons as f64)
        );
    }
    s + "</div>\n"
}

fn viewer(pictures: &[(String, Embedded)], c: &Comparison) -> String {
    if pictures.len() < 2 {
        return String::new();
    }
    let options = |chosen: usize| -> String {
        let one = |(i, (name, _)): (usize, &(String, Embedded))| {
            let mark = if i == chosen { " selected=\"selected\"" } else { "" };
            format!("<option value=\"{i}\"{mark}>{}</option>", escape(name))
        };
        pictures.iter().enumerate().map(one).collect()
    };
    let (w, h) = (c.reference.width, c.reference.height);
    let zoom = (512 / w.max(1)).clamp(1, 8);
    let first = if pictures.len() > 2 { 1 } else { 0 };
    let zooms: String = [1, 2, 4].map(|z| format!("<button data-zoom=\"{z}\">{z}x</button> ")).concat();
    format!(
        "<h2>Pictures</h2>\n<div id=\"viewer\">\n<div class=\"controls\"><select aria-label=\"left\">{}</select> \
         <select aria-label=\"right\">{}</select> <span><button data-mode=\"wipe\" aria-pressed=\"true\">wipe</button> \
         <button data-mode=\"flip\">flip</button> <button data-mode=\"play\">flip by itself</button></span> <span>{zooms}</span> \
         <output></output></div>\n<div class=\"stage\" tabindex=\"0\" style=\"width: {}px; aspect-ratio: {w} / {h}\" \
         data-width=\"{w}\" data-height=\"{h}\" data-zoom=\"{zoom}\"><div class=\"img p{first}\"></div>\
         <div class=\"img p{}\"></div><div class=\"bar\"></div></div>\n<p class=\"soft\">Wipe: move the pointer. Flip: click or \
         press space. First run of each configuration, sRGB, exposure {} stops.</p>\n</div>\n",
        options(first),
        options(first + 1),
        w * zoom,
        first + 1,
        c.exposure
    )
}

fn crop_grid(pictures: &[(String, Embedded)], c: &Comparison) -> String {
    let (w, h) = (c.reference.width, c.reference.height);
    let side = (w.min(h) / 5).clamp(8, 96).min(w).min(h);
    let firsts: Vec<&[Rgb]> =
        c.configurations.iter().filter_map(|k| k.runs.first()).map(|r| r.picture.as_slice()).collect();
    let scale = CROP_WIDTH as f64 / side as f64;
    let mut s = format!(
        "<h2>Crops where the configurations differ most</h2>\n<div class=\"scroll\"><div class=\"crops\" \
         style=\"grid-template-columns: repeat({}, {CROP_WIDTH}px)\">\n",
        pictures.len()
    );
    let chosen = crops(&firsts, &c.reference, side, CROPS);
    for (row, &(x, y)) in chosen.iter().enumerate() {
        for (i, (name, _)) in pictures.iter().enumerate() {
            let caption = if row == 0 { escape(name) } else { String::new() };
            let _ = writeln!(
                s,
                "<figure><figcaption>{caption}</figcaption><div class=\"img p{i}\" role=\"img\" aria-label=\"{} at {x}, {y}\" style=\"height: {CROP_WIDTH}px; \
                 background-size: {:.1}px {:.1}px; background-position: -{:.1}px -{:.1}px\"></div></figure>",
                escape(name),
                w as f64 * scale,
                h as f64 * scale,
                x as f64 * scale,
                y as f64 * scale
            );
        }
    }
    let places: Vec<String> = chosen.iter().map(|(x, y)| format!("({x}, {y})")).collect();
    s + &format!(
        "</div></div>\n<p class=\"soft\">{side} x {side} pixels with their upper left corners at {}, from above.</p>\n",
        places.join(", ")
    )
}

fn maps(c: &Comparison) -> String {
    let (w, h) = (c.reference.width, c.reference.height);
    let figure = |caption: &str, map: &FalseColor| {
        let colors: Vec<String> = map.colors.iter().map(|[r, g, b]| format!("rgb({r}, {g}, {b})")).collect();
        let ticks: String = map.ticks.iter().map(|t| format!("<span>{}</span>", escape(t))).collect();
        format!(
            "<figure style=\"width: {}px; max-width: 100%\"><div class=\"img\" role=\"img\" aria-label=\"{caption}\" \
             style=\"padding-top: {:.2}%; background-image: url({})\"></div><div class=\"scale\" style=\"background: linear-gradient(90deg, {})\"></div>\
             <div class=\"ticks soft\">{ticks}</div><figcaption>{caption}</figcaption></figure>\n",
            w.clamp(240, 320),
            100.0 * h as f64 / w as f64,
            map.picture.address,
            colors.join(", "),
            caption = escape(caption)
        )
    };
    let row = |title: &str, figures: String| {
        if figures.is_empty() { figures } else { format!("<h2>{title}</h2>\n<div class=\"row\">\n{figures}</div>\n") }
    };
    let errors = c.configurations.iter().filter_map(|k| Some((k, error_map(&k.runs.first()?.picture, &c.reference)?)));
    let errors: String = errors.map(|(k, m)| figure(&k.name, &m)).collect();
    let biases: String = c.configurations.iter().filter_map(|k| Some(figure(&k.name, &bias_map(k, c)?))).collect();
    let mut out = row("Relative error of one run, |I - R| / sqrt(R² + 0.01)", errors);
    out += &row("Signed relative error of the mean of all runs: blue too dark, red too bright", biases);

    // Maps of one title share one scale, so that configurations can be compared by eye.
    let mut titles: Vec<&str> = Vec::new();
    for map in c.configurations.iter().flat_map(|k| &k.maps) {
        if !titles.contains(&map.title.as_str()) {
            titles.push(&map.title);
        }
    }
    for title in titles {
        let of_title =
            || c.configurations.iter().flat_map(|k| k.maps.iter().filter(|m| m.title == title).map(move |m| (k, m)));
        let high = of_title().flat_map(|(_, m)| &m.values).fold(0f32, |h, v| h.max(*v));
        let figures =
            of_title().filter_map(|(k, m)| Some(figure(&k.name, &density_map(&m.values, w, h, [0.0, high])?)));
        out += &row(&escape(title), figures.collect());
    }
    out
}

/// Signed relative error of the mean picture of all runs.
fn bias_map(k: &super::comparison::Configuration, c: &Comparison) -> Option<FalseColor> {
    let n = k.runs.len().max(1) as f32;
    let mut mean = vec![Rgb::ZERO; c.reference.mean.len()];
    for run in &k.runs {
        mean.iter_mut().zip(&run.picture).for_each(|(m, p)| *m += *p / n);
    }
    let codes = diff::signed(&mean, &c.reference, BIAS_SCALE);
    let percent = 100.0 * BIAS_SCALE;
    Some(FalseColor {
        picture: Embedded::of_codes(c.reference.width, c.reference.height, &codes)?,
        colors: vec![[0, 0, 255], [255, 255, 255], [255, 0, 0]],
        ticks: vec![format!("-{percent} %"), "0".into(), format!("+{percent} %")],
    })
}

/// How the numbers were made.
fn method(c: &Comparison) -> String {
    let flags: String = c
        .configurations
        .iter()
        .map(|k| {
            let seeds: Vec<String> = k.runs.iter().map(|r| r.seed.to_string()).collect();
            format!(
                "<li><b>{}</b>: <code>{}</code>, integrator {}, seeds {}</li>\n",
                escape(&k.name),
                escape(&k.flags),
                escape(&k.integrator),
                seeds.join(", ")
            )
        })
        .collect();
    let noise = match &c.reference.halves {
        Some(_) => {
            "mean (I-A)(I-B) / (R² + 0.01) with A, B independent halves of the reference and R their mean: free of its noise"
        }
        None => "mean (I-R)² / (R² + 0.01); the reference's own noise is part of it",
    };
    format!(
        "<h2>How it was measured</h2>\n<ul>\n{flags}<li>relMSE: {noise}. Nothing is trimmed unless it says so.</li>\n\
         <li>Bias squared: mean of (X_s - A)(X_t - B) / (R² + 0.01) over pairs of different runs, which holds no variance; its standard \
         error by jackknife. Variance: relMSE less bias squared.</li>\n<li>Intervals are at 95 %: Student's over the runs for means, \
         bootstrap over the runs for speed-ups. They do not hold the reference's own error.</li>\n<li>Runs of different \
         configurations alternate in one process. Times hold preparation and rendering, not loading the scene, building its \
         acceleration structure, or measuring errors.</li>\n<li>Speed-up: CPU time of the first configuration over this one's at the \
         lowest error that both reach, interpolated between points of the log-log curves.</li>\n</ul>\n"
    )
}
