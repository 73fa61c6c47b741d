//! The film: per-pixel sums over samples, from which the picture, its variance and the feature layers follow.
//!
//! Mean      I = sum_i w_i L_i / n, w_i the signed filter weight of mean 1 (filter importance sampling)
//! Variance  of the mean, per channel: (sum x_i^2 / n - I^2) / (n - 1), x_i = w_i L_i. The samples of one pixel are
//!           stratified over the passes, so this is an upper estimate of the true error of the mean.
//! Samples that are not finite are left out and counted elsewhere: the mean is then that of the others.
//! Sums are f64 and are added in the order of the passes, so that the picture does not depend on threads.

use super::guide::Guide;
use crate::math::{Rgb, Vec3};

/// Features of the first surface a camera ray sees; zero where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Features {
    /// Hemispherical albedo.
    pub albedo: Rgb,
    /// Shading normal, world.
    pub normal: Vec3,
    /// Distance along the ray.
    pub depth: f32,
    /// Shape index plus one; 0 for no shape (not averaged: the first sample's).
    pub shape: u32,
    /// What tells the pixel from its neighbours.
    pub guide: Guide,
    /// What the sample is made of, as far as the integrator tells.
    pub makeup: Makeup,
}

/// What a sample is made of and what it took, for debug layers: sums over the samples of a pixel, the light by filter weight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Makeup {
    /// Light straight from the lights; also what glossy surfaces reflect by themselves.
    pub direct: Rgb,
    /// Light on diffuse surfaces from the lights by specular surfaces alone.
    pub caustic: Rgb,
    /// All other light.
    pub indirect: Rgb,
    /// Shadow rays.
    pub shadow_rays: f32,
    /// Paths that went on from diffuse surfaces.
    pub gathers: f32,
    /// 1 if an irradiance cache was looked into with success; the next three are those of the first such look-up.
    pub cached: f32,
    /// Records used.
    pub records: f32,
    /// Mean radius of the records.
    pub radius: f32,
    /// Bound of the relative error of interpolation.
    pub error: f32,
    /// Virtual lights with a contribution, over all points of the sample.
    pub pairs: f32,
    /// Those of them whose shadow ray was certain.
    pub certain: f32,
    /// Those of them at the least probability of a shadow ray.
    pub floored: f32,
    /// 1 if a virtual light that is watched could light the first point; the next three are those of that point.
    pub watched: f32,
    /// Probability that the light was looked at.
    pub selection: f32,
    /// Predicted visibility.
    pub prediction: f32,
    /// Probability of a shadow ray, once it was looked at.
    pub check: f32,
}

impl Makeup {
    fn add(&mut self, o: &Makeup, weight: f32) {
        self.direct += o.direct * weight;
        self.caustic += o.caustic * weight;
        self.indirect += o.indirect * weight;
        self.shadow_rays += o.shadow_rays;
        self.gathers += o.gathers;
        self.cached += o.cached;
        self.records += o.records;
        self.radius += o.radius;
        self.error += o.error;
        self.pairs += o.pairs;
        self.certain += o.certain;
        self.floored += o.floored;
        self.watched += o.watched;
        self.selection += o.selection;
        self.prediction += o.prediction;
        self.check += o.check;
    }

    /// Of sums over `1 / k` samples: light per sample, counts in all, figures of the cache per look-up, of a watched light per point, shares of pairs.
    fn of_sums(&self, k: f32) -> Self {
        let (found, watched, pair) =
            (1.0 / self.cached.max(1.0), 1.0 / self.watched.max(1.0), 1.0 / self.pairs.max(1.0));
        Makeup {
            direct: self.direct * k,
            caustic: self.caustic * k,
            indirect: self.indirect * k,
            cached: self.cached * k,
            records: self.records * found,
            radius: self.radius * found,
            error: self.error * found,
            certain: self.certain * pair,
            floored: self.floored * pair,
            watched: self.watched * k,
            selection: self.selection * watched,
            prediction: self.prediction * watched,
            check: self.check * watched,
            ..*self
        }
    }
}

/// One sample of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct FilmSample {
    /// Radiance.
    pub radiance: Rgb,
    /// Filter weight.
    pub weight: f32,
    /// Features, if they are recorded.
    pub features: Features,
}

/// Sums over the samples of one pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSums {
    sum: [f64; 3],
    sum_sq: [f64; 3],
    /// Sums of the first samples: half of the greatest power of two up to `count`, and all of it.
    first: [[f32; 3]; 2],
    count: u32,
    guide: Guide,
}

impl PixelSums {
    /// Number of samples.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Mean radiance, zero without samples.
    pub fn mean(&self) -> [f64; 3] {
        let n = f64::from(self.count.max(1));
        self.sum.map(|s| s / n)
    }

    /// Estimated variance of the mean by the difference of two halves of the first 2^k samples, as many as there are: it knows that a pixel's
    /// samples are stratified (each half is; of both together it is an upper estimate), and is itself as noisy as a single square. `None` with
    /// fewer than two samples.
    pub fn variance_of_halves(&self) -> Option<[f64; 3]> {
        let all = 1 << Some(self.count).filter(|n| *n > 1)?.ilog2();
        let difference = |c: usize| f64::from(2.0 * self.first[0][c] - self.first[1][c]) / f64::from(all);
        let share = f64::from(all) / f64::from(self.count);
        Some([0, 1, 2].map(|c| difference(c).powi(2) * share))
    }

    /// Mean guides.
    pub fn guide(&self) -> Guide {
        self.guide.scaled(1.0 / self.count.max(1) as f32)
    }

    /// Estimated variance of the mean; infinite with fewer than two samples.
    pub fn variance(&self) -> [f64; 3] {
        let n = f64::from(self.count);
        if self.count < 2 {
            return [f64::INFINITY; 3];
        }
        std::array::from_fn(|c| {
            let mean = self.sum[c] / n;
            ((self.sum_sq[c] / n - mean * mean) / (n - 1.0)).max(0.0)
        })
    }
}

/// A window of the image being made: a tile, or the whole crop window.
#[derive(Clone, Debug)]
pub struct Film {
    /// Left column, in pixels of the full image.
    pub x: u32,
    /// Top row, in pixels of the full image.
    pub y: u32,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    pixels: Vec<PixelSums>,
    features: Vec<Features>,
}

impl Film {
    /// An empty film over the window (x, y, width, height); `features` says whether feature layers are kept.
    pub fn new([x, y, width, height]: [u32; 4], features: bool) -> Self {
        let n = width as usize * height as usize;
        Film {
            x,
            y,
            width,
            height,
            pixels: vec![PixelSums::default(); n],
            features: vec![Features::default(); if features { n } else { 0 }],
        }
    }

    /// Whether feature layers are kept.
    pub fn has_features(&self) -> bool {
        !self.features.is_empty()
    }

    /// Adds a sample to the pixel at column `x` and row `y` of the window.
    pub fn add(&mut self, x: u32, y: u32, sample: &FilmSample) {
        let i = (y * self.width + x) as usize;
        let pixel = &mut self.pixels[i];
        for (c, v) in (sample.radiance * sample.weight).to_array().into_iter().enumerate() {
            let v = f64::from(v);
            pixel.sum[c] += v;
            pixel.sum_sq[c] += v * v;
        }
        pixel.count += 1;
        if pixel.count.is_power_of_two() {
            pixel.first = [pixel.first[1], pixel.sum.map(|s| s as f32)];
        }
        pixel.guide.add(&sample.features.guide);
        if let Some(f) = self.features.get_mut(i) {
            f.albedo += sample.features.albedo;
            f.normal += sample.features.normal;
            f.depth += sample.features.depth;
            f.makeup.add(&sample.features.makeup, sample.weight);
            if pixel.count == 1 {
                f.shape = sample.features.shape;
            }
        }
    }

    /// The sums of all pixels, row-major.
    pub fn pixels(&self) -> &[PixelSums] {
        &self.pixels
    }

    /// Copies a tile, whose window lies within this one, into place.
    pub fn put(&mut self, tile: &Film) {
        let (dx, dy) = ((tile.x - self.x) as usize, (tile.y - self.y) as usize);
        let (w, tw) = (self.width as usize, tile.width as usize);
        for row in 0..tile.height as usize {
            let to = (dy + row) * w + dx;
            self.pixels[to..to + tw].copy_from_slice(&tile.pixels[row * tw..(row + 1) * tw]);
            if self.has_features() && tile.has_features() {
                self.features[to..to + tw].copy_from_slice(&tile.features[row * tw..(row + 1) * tw]);
            }
        }
    }

    /// The picture: mean radiance, row-major. Pixels without a sample yet (an interrupted first pass) take the value of
    /// the first pixel of their block of `block` x `block`, which is sampled first.
    pub fn picture(&self, block: u32) -> Vec<Rgb> {
        let at = |x: u32, y: u32| &self.pixels[(y * self.width + x) as usize];
        (0..self.width * self.height)
            .map(|i| {
                let (x, y) = (i % self.width, i / self.width);
                let own = at(x, y);
                let source = if own.count > 0 { own } else { at(x - x % block, y - y % block) };
                Rgb::from_array(source.mean().map(|v| v as f32))
            })
            .collect()
    }

    /// Estimated variance of the mean, row-major.
    pub fn variance(&self) -> Vec<Rgb> {
        self.pixels.iter().map(|p| Rgb::from_array(p.variance().map(|v| v as f32))).collect()
    }

    /// Mean features, row-major; empty where none are kept. Counts of rays and paths are sums over the pixel's samples.
    pub fn features(&self) -> Vec<Features> {
        let scaled = |(f, p): (&Features, &PixelSums)| {
            let k = 1.0 / p.count.max(1) as f32;
            let makeup = f.makeup.of_sums(k);
            Features {
                albedo: f.albedo * k,
                normal: f.normal * k,
                depth: f.depth * k,
                shape: f.shape,
                guide: p.guide(),
                makeup,
            }
        };
        self.features.iter().zip(&self.pixels).map(scaled).collect()
    }

    /// Mean of the picture and its standard error per channel, from the pixels' variances.
    pub fn mean_and_error(&self) -> ([f64; 3], [f64; 3]) {
        let n = self.pixels.len() as f64;
        let (mut mean, mut var) = ([0.0; 3], [0.0; 3]);
        for p in &self.pixels {
            let (m, v) = (p.mean(), p.variance());
            for c in 0..3 {
                mean[c] += m[c] / n;
                var[c] += v[c] / (n * n);
            }
        }
        (mean, var.map(f64::sqrt))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(v: f32) -> FilmSample {
        FilmSample { radiance: Rgb::splat(v), weight: 1.0, features: Features::default() }
    }

    #[test]
    fn mean_and_variance_of_known_samples() {
        let mut film = Film::new([0, 0, 2, 1], false);
        for v in [1.0, 2.0, 3.0, 6.0] {
            film.add(1, 0, &sample(v));
        }
        assert_eq!(film.picture(1)[1], Rgb::splat(3.0));
        // sum of squared deviations 14, over n (n - 1) = 12
        assert!((film.pixels()[1].variance()[0] - 14.0 / 12.0).abs() < 1e-12);
        // 1.5 and 4.5: a quarter of the squared difference; then four fifths of that, whatever the fifth.
        assert!((film.pixels()[1].variance_of_halves().unwrap()[0] - 2.25).abs() < 1e-12);
        film.add(1, 0, &sample(8.0));
        assert!((film.pixels()[1].variance_of_halves().unwrap()[0] - 1.8).abs() < 1e-12);
        film.add(0, 0, &sample(8.0));
        assert_eq!(film.pixels()[0].variance_of_halves(), None);
        assert_eq!(film.pixels()[0].variance(), [f64::INFINITY; 3]);
    }

    #[test]
    fn missing_pixels_show_the_first_of_their_block() {
        let mut film = Film::new([3, 5, 6, 4], false);
        for (x, y, v) in [(0, 0, 1.0), (4, 0, 2.0), (5, 3, 9.0)] {
            film.add(x, y, &sample(v));
        }
        let p = film.picture(4);
        assert_eq!((p[6 * 3 + 3].x, p[6 * 2 + 5].x, p[6 * 3 + 5].x), (1.0, 2.0, 9.0));
    }

    #[test]
    fn the_makeup_is_weighted_as_the_picture_and_figures_of_the_cache_count_where_it_answered() {
        let mut film = Film::new([0, 0, 1, 1], true);
        let direct = Makeup { direct: Rgb::splat(3.0), shadow_rays: 4.0, ..Makeup::default() };
        let cached =
            Makeup { indirect: Rgb::splat(1.0), shadow_rays: 2.0, cached: 1.0, records: 5.0, radius: 0.5, ..direct };
        for (makeup, v, weight) in [(direct, 3.0, 1.5), (cached, 4.0, 0.5)] {
            film.add(0, 0, &FilmSample { weight, features: Features { makeup, ..Features::default() }, ..sample(v) });
        }
        let m = film.features()[0].makeup;
        assert_eq!((m.direct + m.caustic + m.indirect).x, film.picture(1)[0].x);
        assert_eq!((m.shadow_rays, m.cached, m.records, m.radius), (6.0, 0.5, 5.0, 0.5));
    }

    #[test]
    fn tiles_land_where_their_window_says() {
        let mut film = Film::new([10, 20, 4, 4], true);
        let mut tile = Film::new([12, 21, 2, 2], true);
        tile.add(1, 1, &FilmSample { features: Features { depth: 7.0, ..Features::default() }, ..sample(5.0) });
        film.put(&tile);
        assert_eq!(film.picture(1)[2 * 4 + 3], Rgb::splat(5.0));
        assert_eq!(film.features()[2 * 4 + 3].depth, 7.0);
    }
}
