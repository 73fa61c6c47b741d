//! Virtual point lights: photons' diffuse vertices that light other surfaces.
//!
//! ```text
//! L(x, wo) = sum_i f(x; wo, w_i) |cos_x| I_i(-w_i) G'_i V(x, y_i),     G'_i = 1 / (r^2 + A_i/pi)
//! I_i(w)   = flux_i f*(y_i; w_from, w) |cos_y|                          f* the diffuse part, for importance; Lambert: flux albedo/pi |cos_y|
//! ```
//!
//! In place of a clamp the light of a disc of area A seen along its axis: what is left out of 1/r^2 is the share c(r) = (A/pi) / (r^2 + A/pi), which a short
//! path may add: a direction drawn by the material meets y', and what the diffuse part of y' reflects counts c(r) (Kollig & Keller 2004).
//! Such a path knows no photon, so with compensation one A serves all lights of a pass ([`Area::One`]), a number that does not depend on
//! the pass's own photons; without it each light has the area of its own footprint, A = 4 pi |sigma_1| |sigma_2|, the
//! disc of the same variance (METHODS 6.3), and corners come out darker the larger it is.
//!
//! Partition   a light path belongs to these lights if its last scattering before x is one by the diffuse part of y; light straight from
//!             lamps, caustics at x and what the rest of y scatters are others' (`integrators::many_light` has the table)
//! Measure     fluxes in W, I in W/sr; nothing here has a density
//! Source      Keller 1997; Dachsbacher et al. 2014 (survey); Kollig & Keller 2004 for the compensation
//! Bias        without compensation: energy missing near lights, towards zero with A; none with it
//! Not handled participating media; lights seen through smooth glass (other paths bring them)
//! Verified by tests/many_light.rs: agreement with paths, furnace

use super::World;
use super::eight::{Eight, WIDTH, transposed};
use super::photon_walk::{Goal, WalkSettings, trace};
use crate::emission::{EmissionDensity, Sequence, Uniform};
use crate::formats::ply::points;
use crate::math::{Rgb, Vec3, Vec4};
use crate::scene::{Bsdf, Scene, Transport};
use std::f32::consts::{FRAC_1_PI, PI};

/// Photons of the trial from which the number of photons of a pass, and the one area, follow.
const TRIAL: usize = 4096;
/// Pass number of the trial: no render gets so far.
const TRIAL_PASS: u64 = 1 << 40;
/// Largest footprint, in shares of the cross-section of the scene's bounding sphere: beyond it derivatives say nothing.
const LARGEST: f32 = 0.01;
/// The light's material is a plain Lambertian one.
const LAMBERT: u32 = u32::MAX;
/// The light is a point that sends the same in all directions.
const ISOTROPIC: u32 = u32::MAX - 1;

/// A virtual point light.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Vpl {
    /// Where.
    pub p: Vec3,
    /// A / pi: the squared radius of its disc.
    pub radius2: f32,
    /// Unit geometric normal, on the lit side.
    pub n: Vec3,
    /// Intensity, mean of the channels: along the normal, if the material is Lambertian, else about that.
    pub strength: f32,
    /// Unit shading normal: the light shines above its plane.
    pub n_shade: Vec3,
    /// Segments of the light's way up to here.
    pub segments: u32,
    /// Intensity along the normal (W/sr) of a Lambertian light; flux of another one.
    pub power: Rgb,
    /// Index into `materials`, [`LAMBERT`] or [`ISOTROPIC`].
    material: u32,
}

/// Which area each light's disc has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Area {
    /// That of its photon's footprint, times a factor.
    Own(f32),
    /// One for all, world units squared.
    One(f32),
}

/// The virtual lights of a pass.
#[derive(Debug, Default)]
pub struct Vpls {
    /// All of them.
    pub lights: Vec<Vpl>,
    /// Materials that are not plain Lambertian, with the unit direction that light comes from.
    materials: Vec<(Bsdf, Vec3)>,
    /// Photons emitted.
    pub photons: u64,
    /// Rays traced.
    pub rays: u64,
}

/// Makes the virtual lights of each pass.
#[derive(Debug)]
pub struct VplSource<'a> {
    world: World<'a>,
    density: Uniform<'a>,
    walk: WalkSettings,
    mean_area: f32,
}

impl<'a> VplSource<'a> {
    /// About `wanted` lights a pass. `max_depth`: the longest path from light to eye, both ends included. `None` where no photon is stored.
    pub fn new(world: World<'a>, wanted: usize, max_depth: Option<u32>, rr_depth: u32, seed: u64) -> Option<Self> {
        if world.scene.lights.is_empty() || max_depth.is_some_and(|d| d < 3) {
            return None;
        }
        // One segment from the virtual light to the surface that is seen, and one from there to the eye.
        let most_segments = max_depth.map(|d| d - 2);
        let walk = WalkSettings { seed, most_segments, rr_depth, goal: Goal::Lights };
        let density = Uniform::new(world.scene, TRIAL, Sequence::OwenSobol, seed);
        let trial = trace(world, &density, &walk, TRIAL_PASS);
        if trial.photons.is_empty() {
            return None;
        }
        let per_photon = trial.photons.len() as f64 / density.count().max(1) as f64;
        let photons = ((wanted.max(1) as f64 / per_photon).ceil() as usize).clamp(1, 1 << 26);
        let largest = largest(world.scene);
        let areas: f64 = trial.photons.iter().map(|p| f64::from(footprint(&p.sigma, largest))).sum();
        // A photon's area is in proportion to 1 / n along two parameters, to 1 / sqrt(n) along four: discs shrink with the number of lights
        // as areas do on surfaces that they share.
        let scale = density.count() as f64 / photons as f64;
        let mean_area = (areas / trial.photons.len() as f64 * scale) as f32;
        let density = Uniform::new(world.scene, photons, Sequence::OwenSobol, seed);
        Some(VplSource { world, density, walk, mean_area })
    }

    /// An area like those of the lights' footprints, the same for every pass.
    pub fn mean_area(&self) -> f32 {
        self.mean_area
    }

    /// The lights of a pass: a pure function of settings and pass.
    pub fn lights(&self, area: Area, pass: u64) -> Vpls {
        let traced = trace(self.world, &self.density, &self.walk, pass);
        let largest = largest(self.world.scene);
        let photons = self.density.count() as u64;
        let mut out = Vpls { photons, rays: traced.ledger.total().rays, ..Vpls::default() };
        out.lights.reserve_exact(traced.photons.len());
        for (photon, bsdf) in traced.photons.iter().zip(traced.materials) {
            let radius2 = FRAC_1_PI
                * match area {
                    Area::Own(factor) => factor * footprint(&photon.sigma, largest),
                    Area::One(area) => area,
                };
            let mut light = Vpl {
                p: photon.p,
                radius2,
                n: photon.n,
                strength: 0.0,
                n_shade: photon.n,
                segments: photon.segments,
                power: photon.flux,
                material: LAMBERT,
            };
            match bsdf.lambert(photon.wi) {
                Some((n, albedo)) => {
                    light.power *= albedo * (photon.shading * FRAC_1_PI);
                    light.n_shade = n;
                    light.strength = mean(light.power);
                }
                None => {
                    light.n_shade = bsdf.upper_normal().unwrap_or(photon.n);
                    light.strength = mean(photon.flux * bsdf.albedo(photon.wi)) * FRAC_1_PI;
                    light.material = out.materials.len() as u32;
                    out.materials.push((bsdf, photon.wi));
                }
            }
            if light.strength > 0.0 && light.power.is_finite() {
                out.lights.push(light);
            }
        }
        out
    }
}

impl Vpl {
    /// A point light at `p` of the intensity `power`: no disc.
    pub fn isotropic(p: Vec3, power: Rgb) -> Self {
        Vpl { segments: 0, material: ISOTROPIC, ..Vpl::lambertian(p, Vec3::Z, power, 0.0) }
    }

    /// Whether it sends light to all sides.
    pub fn is_isotropic(&self) -> bool {
        self.material == ISOTROPIC
    }

    /// Whether its material is a plain Lambertian one.
    #[inline]
    pub fn is_lambertian(&self) -> bool {
        self.material == LAMBERT
    }

    /// A Lambertian light at `p` with the unit normal `n` and the intensity `power` along it; `radius2`: A / pi.
    pub fn lambertian(p: Vec3, n: Vec3, power: Rgb, radius2: f32) -> Self {
        Vpl { p, radius2, n, strength: mean(power), n_shade: n, segments: 1, power, material: LAMBERT }
    }
}

/// Eight Lambertian lights side by side.
pub struct EightVpls {
    /// Where.
    pub p: [Eight; 3],
    /// A / pi.
    pub radius2: Eight,
    /// Unit geometric normals, on the lit side.
    pub n: [Eight; 3],
    /// Unit shading normals.
    pub n_shade: [Eight; 3],
    /// Intensities along the normal, W/sr.
    pub power: [Eight; 3],
}

impl Vpls {
    /// The lights with these indices, as if all were Lambertian.
    #[inline(always)]
    pub fn eight(&self, indices: &[u32; WIDTH]) -> EightVpls {
        let (mut p, mut n, mut n_shade, mut power) =
            ([Vec4::ZERO; 8], [Vec4::ZERO; 8], [Vec4::ZERO; 8], [Vec4::ZERO; 8]);
        for k in 0..WIDTH {
            let light = &self.lights[indices[k] as usize];
            p[k] = light.p.extend(light.radius2);
            n[k] = light.n.extend(light.strength);
            // The fourth is not used: what lies there spares a mask.
            n_shade[k] = light.n_shade.extend(f32::from_bits(light.segments));
            power[k] = light.power.extend(f32::from_bits(light.material));
        }
        let [px, py, pz, radius2] = transposed(&p);
        let ([nx, ny, nz, _], [sx, sy, sz, _]) = (transposed(&n), transposed(&n_shade));
        let [red, green, blue, _] = transposed(&power);
        EightVpls { p: [px, py, pz], radius2, n: [nx, ny, nz], n_shade: [sx, sy, sz], power: [red, green, blue] }
    }

    /// Lambertian lights that come from elsewhere.
    pub fn from_lights(lights: Vec<Vpl>) -> Self {
        Vpls { lights, ..Vpls::default() }
    }

    /// Intensity times G' in the unnormalised direction `d` from the light, of squared length `d2`: irradiance across the direction at its end, W/m^2.
    #[inline]
    pub fn arriving(&self, light: &Vpl, d: Vec3, d2: f32) -> Rgb {
        if light.material == ISOTROPIC {
            return light.power / d2;
        }
        let cos = light.n.dot(d);
        if cos <= 0.0 || light.n_shade.dot(d) <= 0.0 {
            return Rgb::ZERO;
        }
        let near = d2 + light.radius2;
        if light.is_lambertian() {
            return light.power * (cos / (d2.sqrt() * near));
        }
        let (bsdf, from) = &self.materials[light.material as usize];
        light.power * bsdf.eval(*from, d / d2.sqrt(), Transport::Importance) / near
    }
}

/// The lights of one set after the other as a point cloud, binary PLY, little-endian: position x y z, normal nx ny nz, power_r power_g power_b (intensity
/// along the normal, W/sr, of Lambertian lights; flux of others, W), radius of the disc, segments of the light's way.
pub fn write_ply<'a>(sets: impl Iterator<Item = &'a Vpls>) -> Vec<u8> {
    const FLOATS: [&str; 10] = ["x", "y", "z", "nx", "ny", "nz", "power_r", "power_g", "power_b", "radius"];
    let lights: Vec<&Vpl> = sets.flat_map(|s| &s.lights).collect();
    let properties: [(&str, &[&str]); 2] = [("float", &FLOATS), ("uint", &["segments"])];
    let mut out = points::header("virtual point lights", lights.len(), &properties);
    for light in lights {
        for v in [light.p, light.n, light.power] {
            v.to_array().iter().for_each(|c| out.extend(c.to_le_bytes()));
        }
        out.extend(light.radius2.sqrt().to_le_bytes());
        out.extend(light.segments.to_le_bytes());
    }
    out
}

/// Share c(r) of what arrives from the squared distance `r2` that virtual lights of the disc `radius2` leave out.
pub fn left_out(r2: f32, radius2: f32) -> f32 {
    if radius2 > 0.0 { radius2 / (r2 + radius2) } else { 0.0 }
}

/// Mean of the channels.
pub fn mean(c: Rgb) -> f32 {
    (c.x + c.y + c.z) * (1.0 / 3.0)
}

fn largest(scene: &Scene) -> f32 {
    LARGEST * PI * scene.bounds.1 * scene.bounds.1
}

/// Area of the disc with a footprint's variance.
fn footprint(sigma: &[Vec3; 2], largest: f32) -> f32 {
    let area = 4.0 * PI * sigma[0].length() * sigma[1].length();
    if area < largest { area } else { largest }
}
