//! Scenes made in code, simple emission densities, and tests of photons against closed forms.

mod agreement;
mod borders;
mod chains;
mod kernel;
mod lanes;
mod maps;
mod obstacles;
mod surfels;
mod tree;
mod walk;

use super::photon_map::{Kernel, PhotonSettings};
use crate::accel::Accel;
use crate::emission::{EmissionDensity, EmittedRay, Spread};
use crate::math::{DMat4, DVec3, Rgb, Sampler, Vec3, polygon, warp};
use crate::scene::description::*;
use crate::scene::{Color, Description, Material, Scene};
use std::f32::consts::PI;

/// A scene and what rays need.
pub struct Room {
    pub scene: Scene,
    pub accel: Accel,
}

impl Room {
    pub fn new(desc: Description) -> Self {
        let scene = Scene::new(desc).expect("the scene is valid");
        let accel = Accel::new(&scene.shapes);
        Room { scene, accel }
    }

    pub fn world(&self) -> super::World<'_> {
        super::World::new(&self.scene, &self.accel)
    }
}

/// A camera far above, one point light (so that ledgers have a light), nothing else.
pub fn empty() -> Description {
    let to_world = DMat4::from_cols(
        DVec3::X.extend(0.0),
        DVec3::Z.extend(0.0),
        (-DVec3::Y).extend(0.0),
        DVec3::new(0.0, 10.0, 0.0).extend(1.0),
    );
    let mut scene = Description::empty(to_world, 64, 64);
    scene.lights.push(LightDesc::Point { position: DVec3::new(0.0, 2.0, 0.0), intensity: Rgb::ONE });
    scene
}

pub fn add_material(scene: &mut Description, material: Material) -> MaterialId {
    scene.materials.push(material);
    scene.materials.len() as MaterialId - 1
}

pub fn diffuse(scene: &mut Description, albedo: f32) -> MaterialId {
    add_material(scene, Material::Diffuse { reflectance: Color::Constant(Rgb::splat(albedo)) })
}

pub fn mirror() -> Material {
    let c = |x: f32| Color::Constant(Rgb::splat(x));
    Material::Conductor { eta: c(0.0), k: c(1.0), specular_reflectance: c(1.0) }
}

pub fn glass(eta: f32) -> Material {
    let c = Color::Constant(Rgb::ONE);
    Material::Dielectric { eta, specular_reflectance: c.clone(), specular_transmittance: c }
}

pub fn add(scene: &mut Description, geometry: GeometryDesc, to_world: DMat4, material: MaterialId) {
    let name = format!("shape {}", scene.shapes.len());
    scene.shapes.push(ShapeDesc { name, geometry, to_world, flip_normals: false, material, emission: None });
}

/// A floor at y = 0, and at y = 1 a screen without end with a square hole, x and z from `low` to `high`, under a sky of radiance 1.
pub fn screened_floor(hole: [f64; 2]) -> Room {
    let mut scene = empty();
    scene.lights = vec![LightDesc::Constant { radiance: Rgb::ONE }];
    add_screened_floor(&mut scene, hole);
    Room::new(scene)
}

/// The floor and the screen of [`screened_floor`], of albedo 0.5.
pub fn add_screened_floor(scene: &mut Description, [low, high]: [f64; 2]) {
    let grey = diffuse(scene, 0.5);
    add(scene, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 1000.0), grey);
    for [x, z] in
        [[[-1e3, 1e3], [-1e3, low]], [[-1e3, 1e3], [high, 1e3]], [[-1e3, low], [low, high]], [[high, 1e3], [low, high]]]
    {
        let (half, middle) = (|[a, b]: [f64; 2]| 0.5 * (b - a), |[a, b]: [f64; 2]| 0.5 * (a + b));
        let to_world = DMat4::from_cols(
            (DVec3::X * half(x)).extend(0.0),
            (DVec3::Z * half(z)).extend(0.0),
            (-DVec3::Y).extend(0.0),
            DVec3::new(middle(x), 1.0, middle(z)).extend(1.0),
        );
        add(scene, GeometryDesc::Rectangle, to_world, grey);
    }
}

/// The sky's irradiance on the floor of [`screened_floor`] at `p`.
pub fn through_hole([low, high]: [f64; 2], p: Vec3) -> f64 {
    let corners = [[low, low], [low, high], [high, high], [high, low]];
    polygon::irradiance(&corners.map(|[x, z]| DVec3::new(x, 1.0, z) - p.as_dvec3()), DVec3::Y).abs()
}

/// Mean and root mean square of errors, and the standard error of the mean.
pub fn moments(errors: &[f64]) -> [f64; 3] {
    let n = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / n;
    let square = errors.iter().map(|e| e * e).sum::<f64>() / n;
    [mean, square.sqrt(), ((square - mean * mean) / n).sqrt()]
}

/// The square `[-half, half]^2` in the plane through `centre` with normal `n`.
pub fn square(centre: DVec3, n: DVec3, half: f64) -> DMat4 {
    let n = n.normalize();
    let x = n.any_orthonormal_vector();
    let y = n.cross(x);
    DMat4::from_cols((x * half).extend(0.0), (y * half).extend(0.0), n.extend(0.0), centre.extend(1.0))
}

/// A point light of intensity 1 that shines on a parallelogram: `n` x `n` cells, affine in direction, one photon in each.
pub struct Aimed {
    pub o: Vec3,
    pub centre: Vec3,
    pub half: [Vec3; 2],
    pub n: usize,
    pub seed: u64,
    /// Photons lie anywhere in the parallelogram, not one in each cell.
    pub random: bool,
}

impl Aimed {
    /// Ray at `p` in `[-1, 1]^2` over the whole parallelogram, with the derivatives over a cell.
    pub fn ray(&self, p: [f32; 2]) -> EmittedRay {
        let (a, b) = (self.half[0], self.half[1]);
        let d = self.centre - self.o + a * p[0] + b * p[1];
        let length = d.length();
        let unit = d / length;
        let h = 1.0 / self.n as f32;
        let along = |v: Vec3| (v - unit * unit.dot(v)) * (h / length);
        let mut spread = Spread::default();
        (spread.d[0], spread.d[1]) = (along(a), along(b));
        let solid_angle = 4.0 * h * h * a.cross(b).dot(d).abs() / length.powi(3);
        EmittedRay { o: self.o, d: unit, flux: Rgb::splat(solid_angle), light: 0, stratum: 0, spread }
    }
}

impl EmissionDensity for Aimed {
    fn count(&self) -> usize {
        self.n * self.n
    }

    fn emit(&self, index: usize, pass: u64) -> Option<EmittedRay> {
        let u = Sampler::new(self.seed, 1 + pass, index as u64).next_2d();
        let n = self.n as f32;
        let cell = [(index % self.n) as f32, (index / self.n) as f32];
        let p = match self.random {
            true => [2.0 * u.x - 1.0, 2.0 * u.y - 1.0],
            false => [2.0 * (cell[0] + u.x) / n - 1.0, 2.0 * (cell[1] + u.y) / n - 1.0],
        };
        Some(self.ray(p))
    }
}

/// A square lamp of radiance 1 that shines along -y: positions and directions stratified n^(1/4) times each.
pub struct Lamp {
    pub centre: Vec3,
    pub half: f32,
    /// Strata along each of the four parameters.
    pub n: usize,
    pub seed: u64,
}

impl EmissionDensity for Lamp {
    fn count(&self) -> usize {
        self.n.pow(4)
    }

    fn emit(&self, index: usize, pass: u64) -> Option<EmittedRay> {
        let u = Sampler::new(self.seed, 100 + pass, index as u64).next_4d();
        let n = self.n as f32;
        let at = |k: u32| ((index / self.n.pow(k) % self.n) as f32 + u[k as usize]) / n;
        let o = self.centre + Vec3::new((2.0 * at(0) - 1.0) * self.half, 0.0, (2.0 * at(1) - 1.0) * self.half);
        let direction = |u: [f32; 2]| {
            let w = warp::sample_cosine_hemisphere(u.into());
            Vec3::new(w.x, -w.z, w.y)
        };
        let u = [at(2), at(3)];
        let d = direction(u);
        let h = 0.5 / n;
        let mut spread = Spread::default();
        (spread.o[0], spread.o[1]) = (Vec3::X * (self.half / n), Vec3::Z * (self.half / n));
        for k in 0..2 {
            let (mut a, mut b) = (u, u);
            a[k] = (a[k] - h).max(1e-4);
            b[k] = (b[k] + h).min(1.0 - 1e-4);
            let by = (direction(b) - direction(a)) * (h / (b[k] - a[k]));
            spread.d[2 + k] = by - d * d.dot(by);
        }
        let power = PI * (2.0 * self.half).powi(2);
        let flux = Rgb::splat(power / self.count() as f32);
        Some(EmittedRay { o, d, flux, light: 0, stratum: index as u32, spread })
    }
}

/// Settings with a kernel and nothing automatic.
pub fn settings(kernel: Kernel) -> PhotonSettings {
    PhotonSettings { kernel, smallest: Some(1e-4), greatest: Some(0.5), ..PhotonSettings::default() }
}
