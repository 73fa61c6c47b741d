//! Writing the picture, its layers and its metadata.

use super::Failure;
use crate::edge::map::Cell;
use crate::image::denoise::denoise;
use crate::image::exr_file::{Attribute, ExrCompression, ExrImage, Precision, write_exr};
use crate::image::film::{Film, Makeup};
use crate::image::png_file::{write_codes, write_png};
use crate::image::{ImageFileError, Window, atomic};
use crate::integrators::Told;
use crate::math::Vec3;
use crate::render::COARSE_BLOCK;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A layer beside the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Aov {
    /// Hemispherical albedo of the first surface (`albedo.R`, `.G`, `.B`).
    Albedo,
    /// Shading normal of the first surface, world (`normal.X`, `.Y`, `.Z`).
    Normal,
    /// Distance to the first surface (`depth.Z`).
    Depth,
    /// Index of the first surface's shape, from 1; 0 = none (`shape.I`).
    Shape,
    /// Estimated variance of the pixel (`variance.R`, `.G`, `.B`).
    Variance,
    /// The picture before the filter of --denoise (`raw.R`, `.G`, `.B`).
    Raw,
    /// Number of samples (`samples.N`).
    Samples,
    /// Shadow rays of all samples (`shadow-rays.N`).
    ShadowRays,
    /// Light straight from the lights, and what glossy surfaces reflect by themselves (`direct.R`, `.G`, `.B`; photon only).
    Direct,
    /// Light on diffuse surfaces by way of specular ones (`caustic.R`, `.G`, `.B`; photon only). The three add up to the picture before the
    /// filter of --denoise.
    Caustic,
    /// All other light (`indirect.R`, `.G`, `.B`; photon only).
    Indirect,
    /// Diffuse surfaces from which paths went on, one or several, of all samples (`gathers.N`; photon only).
    Gathers,
    /// First look-up in the irradiance cache: records used, their mean radius, bound of the relative error, share of samples that found one
    /// (`cache.records`, `.radius`, `.error`, `.found`; photon only).
    Cache,
    /// Roulette of virtual lights: those with a contribution, over all samples, and the shares of them whose shadow ray was certain and whose
    /// probability of one was the least there is (`roulette.pairs`, `.certain`, `.floored`; many-light only).
    Roulette,
    /// The light of --watch-light at the first diffuse surface: probability of selection, predicted visibility, probability of a shadow ray,
    /// share of samples it could light (`watched.pi`, `.q`, `.u`, `.lit`; many-light only).
    Watched,
    /// Predicted edges (`edges.event`, `.kinds`, `.distance`; see `dualux edges --help`).
    Edges,
}

impl Aov {
    /// Whether the integrator has to record features for it.
    pub fn is_feature(self) -> bool {
        matches!(self, Aov::Albedo | Aov::Normal | Aov::Depth | Aov::Shape | Aov::ShadowRays) || self.asks().is_some()
    }

    /// What samples must tell for it.
    pub fn asks(self) -> Option<Told> {
        match self {
            Aov::Direct | Aov::Caustic | Aov::Indirect | Aov::Gathers | Aov::Cache => Some(Told::Parts),
            Aov::Roulette | Aov::Watched => Some(Told::VirtualLights),
            _ => None,
        }
    }
}

/// Where pictures go and what they hold.
#[derive(Debug)]
pub struct Output {
    /// Files, told apart by extension.
    pub paths: Vec<PathBuf>,
    /// Layers of EXR files.
    pub aovs: Vec<Aov>,
    /// Exposure of PNG files, stops.
    pub exposure: f32,
    /// Whether the noise that is left is filtered.
    pub denoise: bool,
    /// Width and height of the full film.
    pub frame: (usize, usize),
    /// The map of edges, if it is asked for: one cell per pixel of the film.
    pub edges: Vec<Cell>,
    /// Metadata that does not change while rendering.
    pub attributes: Vec<(String, Attribute)>,
}

/// Upper estimates of what writing takes, seconds: an EXR file without compression, per value (pixel of a channel) ...
const EXR_SECONDS: f64 = 3e-8;
/// ... what ZIP adds to that ...
const ZIP_SECONDS: f64 = 2.5e-7;
/// ... a PNG file, per pixel, ...
const PNG_SECONDS: f64 = 1.3e-7;
/// ... and the filter, per pixel, on one core.
const DENOISE_SECONDS: f64 = 1.5e-6;
/// Share of the time spent rendering that compression may add. Noise hardly shrinks: short renders do without.
const ZIP_SHARE: f64 = 0.01;

impl Output {
    /// Upper estimate of the time that [`Self::write`] takes at the end of a render of length `spent`.
    pub fn write_time(&self, pixels: usize, spent: Duration) -> Duration {
        let exr = self.values(pixels) as f64 * EXR_SECONDS
            + match self.compression(pixels, spent) {
                ExrCompression::Zip => self.values(pixels) as f64 * ZIP_SECONDS,
                ExrCompression::None => 0.0,
            };
        let one = |path: &PathBuf| if extension(path) == "png" { pixels as f64 * PNG_SECONDS } else { exr };
        let filter =
            if self.denoise { pixels as f64 * DENOISE_SECONDS / rayon::current_num_threads() as f64 } else { 0.0 };
        Duration::from_secs_f64(filter + self.paths.iter().map(one).sum::<f64>())
    }

    /// The picture as it is written, after so many passes.
    pub fn picture(&self, film: &Film, passes: u64) -> Vec<Vec3> {
        if self.denoise && passes > 0 { denoise(film).picture } else { film.picture(COARSE_BLOCK) }
    }

    /// Values in an EXR file.
    fn values(&self, pixels: usize) -> usize {
        let channels = |aov: &Aov| match aov {
            Aov::Cache | Aov::Watched => 4,
            Aov::Albedo | Aov::Normal | Aov::Variance | Aov::Edges | Aov::Raw => 3,
            Aov::Direct | Aov::Caustic | Aov::Indirect | Aov::Roulette => 3,
            Aov::Depth | Aov::Shape | Aov::Samples | Aov::ShadowRays | Aov::Gathers => 1,
        };
        pixels * (3 + self.aovs.iter().map(channels).sum::<usize>())
    }

    /// Compresses what has taken long enough to compute.
    fn compression(&self, pixels: usize, spent: Duration) -> ExrCompression {
        let affordable = self.values(pixels) as f64 * ZIP_SECONDS <= ZIP_SHARE * spent.as_secs_f64();
        if affordable { ExrCompression::Zip } else { ExrCompression::None }
    }

    /// Writes all files from the film's present state. `elapsed` is the age of the process, `spent` the time since the
    /// last files were written.
    pub fn write(&self, film: &Film, passes: u64, elapsed: Duration, spent: Duration) -> Result<(), ImageFileError> {
        let picture = self.picture(film, passes);
        let (width, height) = (film.width as usize, film.height as usize);
        for path in &self.paths {
            if extension(path) == "png" {
                write_png(path, width, height, &picture, self.exposure)?;
                continue;
            }
            let window = Window { x: film.x as i32, y: film.y as i32, width, height };
            let mut image = ExrImage::new(window, self.frame);
            image.compression = self.compression(window.area(), spent);
            image.add_layer("", "RGB", Precision::Float, &picture);
            self.add_layers(&mut image, film);
            image.attributes.clone_from(&self.attributes);
            image.add_attribute("dualux:passes", Attribute::Int(passes as i64));
            image.add_attribute("dualux:seconds", Attribute::Float(elapsed.as_secs_f64()));
            write_exr(path, &image)?;
        }
        Ok(())
    }

    fn add_layers(&self, image: &mut ExrImage, film: &Film) {
        let features = film.features();
        let light = |image: &mut ExrImage, name: &str, of: fn(&Makeup) -> Vec3| {
            let v: Vec<Vec3> = features.iter().map(|f| of(&f.makeup)).collect();
            image.add_layer(name, "RGB", Precision::Float, &v);
        };
        let number = |image: &mut ExrImage, layer: &str, name: &str, of: fn(&Makeup) -> f32| {
            image.add_channel(layer, name, Precision::Float, features.iter().map(|f| of(&f.makeup)).collect());
        };
        for aov in &self.aovs {
            match aov {
                Aov::Albedo => {
                    let v: Vec<Vec3> = features.iter().map(|f| f.albedo).collect();
                    image.add_layer("albedo", "RGB", Precision::Half, &v);
                }
                Aov::Normal => {
                    let v: Vec<Vec3> = features.iter().map(|f| f.normal).collect();
                    image.add_layer("normal", "XYZ", Precision::Float, &v);
                }
                Aov::Depth => {
                    let v = features.iter().map(|f| f.depth).collect();
                    image.add_channel("depth", "Z", Precision::Float, v);
                }
                Aov::Shape => {
                    let v = features.iter().map(|f| f.shape as f32).collect();
                    image.add_channel("shape", "I", Precision::Float, v);
                }
                Aov::Direct => light(image, "direct", |m| m.direct),
                Aov::Caustic => light(image, "caustic", |m| m.caustic),
                Aov::Indirect => light(image, "indirect", |m| m.indirect),
                Aov::ShadowRays => number(image, "shadow-rays", "N", |m| m.shadow_rays),
                Aov::Gathers => number(image, "gathers", "N", |m| m.gathers),
                Aov::Cache => {
                    number(image, "cache", "records", |m| m.records);
                    number(image, "cache", "radius", |m| m.radius);
                    number(image, "cache", "error", |m| m.error);
                    number(image, "cache", "found", |m| m.cached);
                }
                Aov::Roulette => {
                    number(image, "roulette", "pairs", |m| m.pairs);
                    number(image, "roulette", "certain", |m| m.certain);
                    number(image, "roulette", "floored", |m| m.floored);
                }
                Aov::Watched => {
                    number(image, "watched", "pi", |m| m.selection);
                    number(image, "watched", "q", |m| m.prediction);
                    number(image, "watched", "u", |m| m.check);
                    number(image, "watched", "lit", |m| m.watched);
                }
                Aov::Raw => image.add_layer("raw", "RGB", Precision::Float, &film.picture(COARSE_BLOCK)),
                Aov::Variance => image.add_layer("variance", "RGB", Precision::Float, &film.variance()),
                Aov::Edges => {
                    for (name, values) in edge_channels(&self.edges) {
                        image.add_channel("edges", name, Precision::Float, values);
                    }
                }
                Aov::Samples => {
                    let v = film.pixels().iter().map(|p| p.count() as f32).collect();
                    image.add_channel("samples", "N", Precision::Float, v);
                }
            }
        }
    }
}

/// Checks that a name says a kind that can be written, in a folder that can be written to: before the work, not after.
pub fn check_name(path: &Path) -> Result<(), Failure> {
    if !matches!(extension(path).as_str(), "exr" | "png") {
        return Err(format!("{}: the output's name must end in .exr or .png", path.display()).into());
    }
    Ok(atomic::check(path)?)
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// The text of an error with its causes, for stderr.
pub fn error_text(error: &(dyn Error + 'static)) -> String {
    let text = error.to_string();
    // Located messages start with their place and say `error` themselves.
    if text.contains(": error: ") { text } else { format!("error: {text}") }
}

/// Channels of a map of footprints.
pub fn edge_channels(map: &[Cell]) -> [(&'static str, Vec<f32>); 3] {
    [
        ("event", map.iter().map(|c| f32::from(u8::from(c.event))).collect()),
        ("kinds", map.iter().map(|c| f32::from(c.kinds.0)).collect()),
        ("distance", map.iter().map(|c| c.distance as f32).collect()),
    ]
}

/// Writes a map of footprints, its name checked before: `codes` (sRGB, 0..1) as PNG, or the channels as EXR.
pub fn write_map(
    path: &Path,
    window: Window,
    frame: (usize, usize),
    codes: &[Vec3],
    channels: &[(&str, Vec<f32>)],
) -> Result<(), Failure> {
    if extension(path) == "png" {
        let byte = |x: f32| (x * 255.0).round().clamp(0.0, 255.0) as u8;
        let bytes: Vec<u8> = codes.iter().flat_map(|c| c.to_array()).map(byte).collect();
        return Ok(write_codes(path, window.width, window.height, &bytes)?);
    }
    let mut image = ExrImage::new(window, frame);
    for (name, values) in channels {
        image.add_channel("", name, Precision::Float, values.clone());
    }
    Ok(write_exr(path, &image)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_renders_are_not_compressed_and_long_ones_are() {
        let output = |aovs| Output {
            paths: vec!["a.exr".into(), "b.PNG".into()],
            aovs,
            exposure: 0.0,
            denoise: false,
            frame: (512, 512),
            edges: Vec::new(),
            attributes: Vec::new(),
        };
        let (plain, layered) = (output(vec![]), output(vec![Aov::Albedo, Aov::Depth]));
        let seconds = Duration::from_secs;
        assert_eq!(plain.compression(512 * 512, seconds(1)), ExrCompression::None);
        assert_eq!(plain.compression(512 * 512, seconds(60)), ExrCompression::Zip);
        assert_eq!(layered.values(100), 700);
        // What is kept back stays a small share of any limit that leaves time to render at all.
        assert!(plain.write_time(512 * 512, seconds(1)) < Duration::from_millis(100));
        assert!(layered.write_time(512 * 512, seconds(60)) < Duration::from_millis(1000));
    }
}
