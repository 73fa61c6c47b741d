//! From the command line to a scene ready to be rendered.

use super::Failure;
use super::options;
use crate::accel::{Accel, Simd};
use crate::formats::{self, LoadOptions, Loaded};
use crate::math::filter::PixelFilter;
use crate::scene::{Description, Scene};
use std::path::PathBuf;

/// Options of every subcommand that reads a scene.
#[derive(Clone, Debug, clap::Args)]
pub struct SceneArgs {
    /// Scene file (Mitsuba XML, version 0.4 to 3).
    pub scene: PathBuf,
    /// Set the scene's parameter KEY ($KEY in the file) to VALUE; may be repeated.
    #[arg(short = 'D', value_name = "KEY=VALUE", value_parser = options::definition)]
    pub define: Vec<(String, String)>,
    /// Treat unknown words in the scene file as errors.
    #[arg(long)]
    pub strict: bool,
    /// Number of threads [default: one per core].
    #[arg(short = 't', long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Instruction set of the ray traversal. The picture is the same, bit for bit.
    #[arg(long, value_enum, default_value_t = SimdChoice::Auto)]
    pub simd: SimdChoice,
}

/// Instruction set of the ray traversal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum SimdChoice {
    /// The best this processor has.
    Auto,
    /// Plain code without processor-specific instructions.
    Portable,
}

impl From<SimdChoice> for Simd {
    fn from(choice: SimdChoice) -> Simd {
        match choice {
            SimdChoice::Auto => Simd::Avx2,
            SimdChoice::Portable => Simd::Portable,
        }
    }
}

impl SceneArgs {
    /// Reads the scene file; warnings are returned, not printed. Sets up the thread pool first, since loading uses it.
    pub fn read(&self) -> Result<Loaded, Failure> {
        if let Some(n) = self.threads {
            // Fails only if the pool exists already, and then has nothing to say.
            let _ = rayon::ThreadPoolBuilder::new().num_threads(usize::from(n)).build_global();
        }
        let options = LoadOptions { strict: self.strict, defines: self.define.clone() };
        Ok(formats::load(&self.scene, &options)?)
    }

    /// Builds the scene and its acceleration structure.
    pub fn build(&self, description: Description) -> Result<(Scene, Accel), Failure> {
        let scene = Scene::new(description)?;
        let accel = Accel::with_simd(&scene.shapes, self.simd.into());
        Ok((scene, accel))
    }
}

/// Changes the size of the film by `scale`; the view stays. The crop window scales with it.
pub fn scale_film(description: &mut Description, scale: f64) -> Result<(), Failure> {
    let film = &mut description.film;
    let scaled = |n: u32| (f64::from(n) * scale).round();
    let (width, height) = (scaled(film.width).max(1.0), scaled(film.height).max(1.0));
    if width * height > f64::from(1 << 28) {
        return Err(format!("--scale {scale}: an image of {width} x {height} pixels is too large").into());
    }
    let [x, y, w, h] = film.crop;
    (film.width, film.height) = (width as u32, height as u32);
    let (x, y) = ((scaled(x) as u32).min(film.width - 1), (scaled(y) as u32).min(film.height - 1));
    let (w, h) = (scaled(w).max(1.0) as u32, scaled(h).max(1.0) as u32);
    film.crop = [x, y, w.min(film.width - x), h.min(film.height - y)];
    Ok(())
}

/// Restricts the film to `window`, which must lie in it.
pub fn crop_film(description: &mut Description, window: [u32; 4]) -> Result<(), Failure> {
    let film = &mut description.film;
    let [x, y, w, h] = window.map(u64::from);
    if x + w > u64::from(film.width) || y + h > u64::from(film.height) {
        let [width, height] = [film.width, film.height];
        return Err(format!("--crop {x},{y},{w},{h} does not lie in the image of {width} x {height} pixels").into());
    }
    film.crop = window;
    Ok(())
}

/// Name of a pixel filter for `info`.
pub fn filter_name(filter: PixelFilter) -> &'static str {
    match filter {
        PixelFilter::Box { .. } => "box",
        PixelFilter::Tent { .. } => "tent",
        PixelFilter::Gaussian { .. } => "gaussian",
        PixelFilter::Mitchell { .. } => "mitchell",
        PixelFilter::CatmullRom => "catmullrom",
        PixelFilter::Lanczos { .. } => "lanczos",
    }
}
