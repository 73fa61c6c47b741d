//! Light from infinity: constant, or a latitude-longitude map.
//!
//! Measure: `pdf_dir`, per solid angle. The map is looked up as Mitsuba 3 does (measured against 3.9.1), bilinearly, with
//! texel *centres* at u = (i + 1/2) / width and rows at v = j / (height - 1): the first and last row lie on the poles.
//! Its density is constant on each cell between four neighbouring texels, in proportion to the cell's solid angle times
//! the mean of the four: wherever the interpolated radiance is above 0, so is the density, and inside a cell
//! directions are uniform per solid angle (cos is interpolated, not the angle), so it is finite at the poles.
//! Bias: none. Not handled: sampling in proportion to the receiver's cosine.

use super::delta::rotation_to_local;
use crate::math::distribution::{Cell, Piecewise2};
use crate::math::warp::{pdf_sphere, sample_sphere};
use crate::math::{DVec3, Mat3, Rgb, Vec2, Vec3, luminance};
use crate::scene::description::{ImageId, LightDesc};
use crate::scene::texture::Bitmap;
use std::f32::consts::{PI, TAU};

/// A light at infinity.
#[derive(Clone, Debug)]
pub enum Environment {
    /// The same from everywhere.
    Constant {
        /// Radiance.
        radiance: Rgb,
    },
    /// A map.
    Map(Box<EnvMap>),
}

/// A latitude-longitude map with its density.
#[derive(Clone, Debug)]
pub struct EnvMap {
    image: ImageId,
    scale: Rgb,
    to_local: Mat3,
    density: Piecewise2,
    /// Cosines of the angles from +y that bound the rows of cells.
    cos: Vec<f64>,
    /// Integral of the radiance over all directions.
    integral: Rgb,
    /// Greatest luminance of a texel.
    peak: f32,
}

/// A direction drawn from a map.
#[derive(Clone, Copy, Debug)]
pub struct DrawnDirection {
    /// Unit direction away from the scene, world.
    pub w: DVec3,
    /// Derivatives by the two numbers, inside of the cell of the map's table.
    pub w_u: [DVec3; 2],
    /// Density per solid angle.
    pub pdf_dir: f64,
}

impl Environment {
    /// The light of a description, if it is one at infinity.
    pub(super) fn new(desc: &LightDesc, images: &[Bitmap]) -> Option<Self> {
        match desc {
            LightDesc::Constant { radiance } => Some(Environment::Constant { radiance: *radiance }),
            LightDesc::EnvMap { image, scale, to_world } => {
                let map = EnvMap::new(*image, &images[*image as usize], *scale, rotation_to_local(to_world));
                // A map without pixels is black.
                Some(map.map_or(Environment::Constant { radiance: Rgb::ZERO }, |m| Environment::Map(Box::new(m))))
            }
            _ => None,
        }
    }

    /// Kind for [`super::LightInfo`].
    pub fn kind(&self) -> &'static str {
        match self {
            Environment::Constant { .. } => "constant",
            Environment::Map(_) => "envmap",
        }
    }

    /// What enters a sphere of `radius`, W: pi R^2 times the integral of the radiance over directions.
    pub fn power(&self, radius: f32) -> Rgb {
        let integral = match self {
            Environment::Constant { radiance } => *radiance * (2.0 * TAU),
            Environment::Map(m) => m.integral,
        };
        integral * (PI * radius * radius)
    }

    /// Greatest luminance over the mean over all directions: 1 for a constant one, thousands for a sun in a map. 0 if black.
    pub fn contrast(&self) -> f32 {
        match self {
            Environment::Constant { radiance } => f32::from(u8::from(luminance(*radiance) > 0.0)),
            Environment::Map(m) => {
                let mean = luminance(m.integral) / (2.0 * TAU);
                if mean > 0.0 { m.peak / mean } else { 0.0 }
            }
        }
    }

    /// Radiance from the unit direction `w`.
    pub fn radiance(&self, images: &[Bitmap], w: Vec3) -> Rgb {
        match self {
            Environment::Constant { radiance } => *radiance,
            Environment::Map(m) => m.radiance(&images[m.image as usize], w),
        }
    }

    /// Draws a direction.
    pub fn sample(&self, u: Vec2) -> Vec3 {
        match self {
            Environment::Constant { .. } => sample_sphere(u),
            Environment::Map(m) => m.sample(u),
        }
    }

    /// Draws a direction as [`Self::sample`] does; with its radiance and density.
    pub fn sample_with_radiance(&self, images: &[Bitmap], u: Vec2) -> (Vec3, Rgb, f32) {
        match self {
            Environment::Constant { radiance } => (sample_sphere(u), *radiance, pdf_sphere()),
            Environment::Map(m) => m.sample_with_radiance(&images[m.image as usize], u),
        }
    }

    /// Density of [`Self::sample`] at the unit direction `w`.
    pub fn pdf_dir(&self, w: Vec3) -> f32 {
        match self {
            Environment::Constant { .. } => pdf_sphere(),
            Environment::Map(m) => m.pdf_dir(w),
        }
    }
}

impl EnvMap {
    fn new(image: ImageId, map: &Bitmap, scale: Rgb, to_local: Mat3) -> Option<Self> {
        let (w, h) = (map.width, map.height);
        if w == 0 || h == 0 {
            return None;
        }
        let rows = (h - 1).max(1);
        let cos: Vec<f64> = (0..=rows).map(|j| (std::f64::consts::PI * j as f64 / rows as f64).cos()).collect();
        let mut values = Vec::with_capacity(w * rows);
        let mut integral = [0f64; 3];
        for j in 0..rows {
            // Relative to the whole sphere times 1 / width.
            let share = 0.5 * (cos[j] - cos[j + 1]);
            let (above, below) = (&map.pixels[j * w..(j + 1) * w], &map.pixels[(h - 1).min(j + 1) * w..]);
            for i in 0..w {
                let k = (i + 1) % w;
                let mean = 0.25 * scale * (above[i] + above[k] + below[i] + below[k]);
                values.push(mean.element_sum() / 3.0 * share as f32);
                for (sum, m) in integral.iter_mut().zip(mean.to_array()) {
                    *sum += m as f64 * share;
                }
            }
        }
        let total = integral.map(|x| (x * 4.0 * std::f64::consts::PI / w as f64) as f32);
        let peak = map.pixels.iter().map(|&c| luminance(c * scale)).fold(0.0, f32::max);
        let density = Piecewise2::new(&values, w);
        Some(EnvMap { image, scale, to_local, density, cos, integral: Rgb::from(total), peak })
    }

    /// Column, row and position inside of the cell that holds the local direction `d`; rows linear in the angle.
    fn cell(&self, d: Vec3) -> (usize, usize, Vec2) {
        let (w, rows) = (self.density.width(), self.density.height());
        let turn = d.x.atan2(-d.z) * (1.0 / TAU) * w as f32 - 0.5;
        let turn = if turn < 0.0 { turn + w as f32 } else { turn };
        // atan2 instead of acos: exact near the poles.
        let down = (d.x * d.x + d.z * d.z).sqrt().atan2(d.y) * (1.0 / PI) * rows as f32;
        let (i, j) = ((turn as usize).min(w - 1), (down as usize).min(rows - 1));
        (i, j, Vec2::new((turn - i as f32).min(1.0), (down - j as f32).min(1.0)))
    }

    fn radiance(&self, map: &Bitmap, w: Vec3) -> Rgb {
        let (i, j, f) = self.cell(self.to_local * w);
        self.interpolated(map, i, j, f)
    }

    /// Radiance at the position `f` inside of a cell.
    fn interpolated(&self, map: &Bitmap, i: usize, j: usize, f: Vec2) -> Rgb {
        let k = if i + 1 == map.width { 0 } else { i + 1 };
        let row = |j: usize| {
            let row = &map.pixels[j.min(map.height - 1) * map.width..];
            row[i].lerp(row[k], f.x)
        };
        row(j).lerp(row(j + 1), f.y) * self.scale
    }

    fn sample(&self, u: Vec2) -> Vec3 {
        self.direction(&self.density.sample_cell(u)).0
    }

    fn sample_with_radiance(&self, map: &Bitmap, u: Vec2) -> (Vec3, Rgb, f32) {
        let c = self.density.sample_cell(u);
        let (w, sin, cos) = self.direction(&c);
        // The map is linear in the angle, directions are uniform in its cosine.
        let down = sin.atan2(cos) * (1.0 / PI) * self.density.height() as f32 - c.y as f32;
        let inside = Vec2::new(c.inside.x, down.clamp(0.0, 1.0));
        (w, self.interpolated(map, c.x, c.y, inside), c.pmf / self.solid_angle(c.y))
    }

    /// World direction of a position in a cell, sine and cosine of its angle from +y.
    fn direction(&self, c: &Cell) -> (Vec3, f32, f32) {
        let phi = TAU * (c.x as f32 + 0.5 + c.inside.x) / self.density.width() as f32;
        let cos = self.cos[c.y] + c.inside.y as f64 * (self.cos[c.y + 1] - self.cos[c.y]);
        let sin = (1.0 - cos * cos).max(0.0).sqrt() as f32;
        let local = Vec3::new(sin * phi.sin(), cos as f32, -sin * phi.cos());
        ((self.to_local.transpose() * local).normalize(), sin, cos as f32)
    }

    fn pdf_dir(&self, w: Vec3) -> f32 {
        let (i, j, _) = self.cell(self.to_local * w);
        self.density.pmf(i, j) / self.solid_angle(j)
    }

    /// Solid angle of a cell in row `j`.
    fn solid_angle(&self, j: usize) -> f32 {
        TAU / self.density.width() as f32 * (self.cos[j] - self.cos[j + 1]) as f32
    }

    /// What [`Environment::sample`] draws for `u`, with derivatives and density: the map's primary-sample space.
    pub fn drawn(&self, u: Vec2) -> DrawnDirection {
        let c = self.density.sample_cell(u);
        let width = self.density.width() as f64;
        let cell = self.density.cell_size(c.x, c.y).as_dvec2();
        let step = self.cos[c.y + 1] - self.cos[c.y];
        let (sin_phi, cos_phi) = (std::f64::consts::TAU * (c.x as f64 + 0.5 + c.inside.x as f64) / width).sin_cos();
        let cos = self.cos[c.y] + c.inside.y as f64 * step;
        let sin = (1.0 - cos * cos).max(1e-16).sqrt();
        let to_world = self.to_local.transpose().as_dmat3();
        let world = |x: f64, y: f64, z: f64| to_world * DVec3::new(x, y, z);
        let phi_u = std::f64::consts::TAU / (width * cell.x);
        let cos_u = step / cell.y;
        let sin_u = -cos * cos_u / sin;
        DrawnDirection {
            w: world(sin * sin_phi, cos, -sin * cos_phi),
            w_u: [world(sin * cos_phi, 0.0, sin * sin_phi) * phi_u, world(sin_u * sin_phi, cos_u, -sin_u * cos_phi)],
            pdf_dir: f64::from(c.pmf) / f64::from(self.solid_angle(c.y)),
        }
    }

    /// The numbers that [`Self::drawn`] turns into the unit direction `w`.
    pub fn invert(&self, w: Vec3) -> Vec2 {
        let local = self.to_local * w;
        let (i, j, f) = self.cell(local);
        let down = (self.cos[j] - f64::from(local.y)) / (self.cos[j] - self.cos[j + 1]);
        self.density.invert_cell(i, j, Vec2::new(f.x, (down as f32).clamp(0.0, 1.0)))
    }
}
