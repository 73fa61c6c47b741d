//! `dualux metric`: the errors of a picture against a reference.
//!
//! The errors are defined in [`crate::image::metrics`].

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use crate::image::metrics::{Errors, Reference};
use crate::image::{Picture, atomic, diff, png_file, read_image};

/// Compare a picture with a reference.
///
/// Prints RMSE; relMSE = mean (I-R)^2/(R^2+0.01), untrimmed and trimmed; bias of the means; the relMSE of 8x8 block means; FLIP.
/// Given two independent halves A and B of a reference, R = (A+B)/2, and mean (I-A)(I-B)/(R^2+0.01) is printed too: it is free
/// of the reference's own noise. Pixels where the reference is not finite, or its channel `mask` is 0, do not count.
#[derive(Args, Clone, Debug)]
pub struct MetricArgs {
    /// The picture (EXR, PNG, JPEG, BMP, HDR or PFM; a crop is compared with the same crop of the reference).
    pub image: PathBuf,
    /// The reference, or its first half.
    pub reference: PathBuf,
    /// The second, independent half of the reference.
    pub reference_b: Option<PathBuf>,
    /// Print JSON instead of a table.
    #[arg(long)]
    pub json: bool,
    /// Write a picture of the error (PNG).
    #[arg(long, value_name = "FILE")]
    pub diff: Option<PathBuf>,
    /// What that picture shows.
    #[arg(long, value_enum, default_value_t = DiffKind::Signed, requires = "diff")]
    pub diff_kind: DiffKind,
    /// Relative error shown in full colour.
    #[arg(long, default_value_t = 0.5, value_parser = positive, requires = "diff")]
    pub diff_scale: f32,
    /// Per cent of the pixels, the worst ones, that the trimmed relMSE drops.
    #[arg(long, default_value_t = 0.1, value_parser = percent)]
    pub trim: f64,
}

/// Kinds of error pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DiffKind {
    /// Signed relative error: red too bright, blue too dark, white equal.
    Signed,
    /// Heat map of FLIP: black equal, white as different as can be.
    Flip,
}

fn positive(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(v) if v > 0.0 && v.is_finite() => Ok(v),
        _ => Err("must be a number above 0".into()),
    }
}

fn percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if (0.0..=100.0).contains(&v) => Ok(v),
        _ => Err("must be a number from 0 to 100".into()),
    }
}

/// Compares and prints to stdout.
///
/// # Errors
/// If a file cannot be read or written, or the sizes disagree.
pub fn run(args: &MetricArgs) -> Result<(), Box<dyn Error + Send + Sync>> {
    if let Some(path) = &args.diff {
        if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png")) {
            return Err(format!("{}: the name of the difference picture must end in .png", path.display()).into());
        }
        atomic::check(path)?;
    }
    let errors = compare(args)?;
    let text = if args.json { serde_json::to_string_pretty(&errors)? + "\n" } else { table(&errors) };
    super::print(text)
}

/// Reads the files, computes the errors, writes the difference picture if one is asked for.
fn compare(args: &MetricArgs) -> Result<Errors, Box<dyn Error + Send + Sync>> {
    let image = read_image(&args.image)?;
    let a = read_reference(&args.reference, &image)?;
    let b = args.reference_b.as_ref().map(|path| read_reference(path, &image)).transpose()?;
    let in_files = |message: String| format!("{}, {}: {message}", args.image.display(), args.reference.display());
    let reference = Reference::new(&a, b.as_ref()).map_err(in_files)?;
    let errors = reference.errors(&image, args.trim).map_err(in_files)?;
    if let Some(path) = &args.diff {
        let pixels = reference.prepare(&image).map_err(in_files)?;
        let codes = match args.diff_kind {
            DiffKind::Signed => diff::signed(&pixels, &reference, args.diff_scale),
            DiffKind::Flip => diff::flip_map(&pixels, &reference),
        };
        png_file::write_codes(path, reference.width, reference.height, &codes)?;
    }
    Ok(errors)
}

/// A reference; if `image` is a crop of a frame of the reference's size, that crop of it.
fn read_reference(path: &Path, image: &Picture) -> Result<Picture, crate::image::ImageFileError> {
    let reference = read_image(path)?;
    if reference.frame == image.frame && reference.window != image.window {
        return Ok(reference.cropped(image.window).unwrap_or(reference));
    }
    Ok(reference)
}

fn table(e: &Errors) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:<28} {value}");
    };
    line("pixels", e.pixels.to_string());
    line("masked by the reference", e.masked.to_string());
    line("not finite (taken as black)", e.nonfinite.to_string());
    line("RMSE", format!("{:.4e}", e.rmse));
    line("relMSE, untrimmed", format!("{:.4e}", e.relmse));
    line(&format!("relMSE, worst {} % dropped", e.trim_percent), format!("{:.4e}", e.relmse_trimmed));
    if let Some(value) = e.relmse_noise_free {
        line("relMSE, noise-free", format!("{value:.4e}"));
    }
    line("8x8 blocks, relMSE", format!("{:.4e}", e.blocks));
    if let Some(value) = e.blocks_noise_free {
        line("8x8 blocks, noise-free", format!("{value:.4e}"));
    }
    line("bias of the mean", format!("{:+.3} %", e.bias_percent));
    let [r, g, b] = e.bias_rgb_percent;
    line("bias R, G, B", format!("{r:+.3} %, {g:+.3} %, {b:+.3} %"));
    line("FLIP (LDR, 67 ppd)", format!("{:.5}", e.flip));
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Window;
    use crate::image::exr_file::{ExrImage, Precision, write_exr};
    use crate::math::Rgb;
    use clap::Parser;

    #[derive(Parser)]
    struct Wrapper {
        #[command(flatten)]
        args: MetricArgs,
    }

    fn write(path: &Path, window: Window, value: impl Fn(i32, i32) -> f32) {
        let at = |i: usize| value(window.x + (i % window.width) as i32, window.y + (i / window.width) as i32);
        let pixels: Vec<Rgb> = (0..window.area()).map(|i| Rgb::splat(at(i))).collect();
        let mut image = ExrImage::new(window, (32, 24));
        image.add_layer("", "RGB", Precision::Float, &pixels);
        write_exr(path, &image).unwrap();
    }

    fn compare_files(words: &[&str]) -> Result<Errors, String> {
        let words = std::iter::once("metric").chain(words.iter().copied());
        let parsed = Wrapper::try_parse_from(words).map_err(|e| e.to_string())?;
        compare(&parsed.args).map_err(|e| e.to_string())
    }

    #[test]
    fn files_are_compared_cropped_and_drawn() {
        let folder = tempfile::tempdir().unwrap();
        let name = |s: &str| folder.path().join(s).to_str().unwrap().to_owned();
        let [image, a, b, crop, small] = ["i.exr", "a.exr", "b.exr", "c.exr", "s.exr"].map(name);
        let full = Window::full(32, 24);
        let value = |x: i32, y: i32| 0.1 + 0.01 * x as f32 + 0.02 * y as f32;
        write(Path::new(&image), full, |x, y| 1.1 * value(x, y));
        write(Path::new(&a), full, value);
        write(Path::new(&b), full, value);
        let part = Window { x: 8, y: 4, width: 16, height: 16 };
        write(Path::new(&crop), part, |x, y| 1.1 * value(x, y));
        write(Path::new(&small), Window::full(8, 8), value);

        let diff = name("d.png");
        let e = compare_files(&[&image, &a, &b, "--diff", &diff, "--diff-kind", "flip"]).unwrap();
        assert!((e.bias_percent - 10.0).abs() < 1e-3);
        assert!((e.relmse_noise_free.unwrap() - e.relmse).abs() < 1e-9);
        assert_eq!(read_image(Path::new(&diff)).unwrap().width(), 32);
        assert!(table(&e).contains("noise-free"));
        let json: serde_json::Value = serde_json::from_str(&serde_json::to_string(&e).unwrap()).unwrap();
        assert!(json["relmse"].as_f64().unwrap() > 0.0 && json["bias_rgb_percent"].as_array().unwrap().len() == 3);

        let e = compare_files(&[&crop, &a]).unwrap();
        assert_eq!(e.pixels, 256);
        assert!((e.bias_percent - 10.0).abs() < 1e-3, "the crop lies where it was rendered");
        assert!(e.relmse_noise_free.is_none() && !table(&e).contains("noise-free"));

        let message = compare_files(&[&image, &small]).unwrap_err();
        assert!(message.contains("s.exr") && message.contains("32 x 24") && message.contains("8 x 8"), "{message}");
    }

    #[test]
    fn wrong_words_are_refused() {
        assert!(compare_files(&["a.exr"]).is_err());
        assert!(compare_files(&["a.exr", "b.exr", "--trim", "200"]).is_err());
        assert!(compare_files(&["a.exr", "b.exr", "--diff", "d.png", "--diff-scale", "0"]).is_err());
        assert!(compare_files(&["/no/a.exr", "/no/b.exr"]).unwrap_err().contains("/no/a.exr"));
    }
}
