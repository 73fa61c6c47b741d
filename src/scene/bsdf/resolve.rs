//! From a [`Material`] to the lobes of a [`super::Bsdf`]: textures looked up, nesting flattened, frames turned.
//!
//! `TwoSided` takes the side `wo` is on and mirrors the frame; `Blend` and `Mask` multiply weights; bump and normal maps
//! replace the frame. Source of the slope of a bump map: Blinn 1978 without the derivative of the normal; of the flip of
//! normals that `wo` cannot see: Schuessler et al. 2017. Conventions as in Mitsuba 3.9.
//! Not handled: of nested bump or normal maps, the side test and the shadowing term see only the outermost normal and the
//! innermost one.

use super::clamp_or_low;
use super::conductor::{Metal, RoughMetal};
use super::dielectric::{Boundary, RoughBoundary};
use super::diffuse::{Lambert, OrenNayar};
use super::layer::{Layer, Perturbation};
use super::lobe::Lobe;
use super::microfacet::Microfacet;
use super::plastic::{Plastic, RoughPlastic};
use crate::math::{Frame, Rgb, Vec3};
use crate::scene::material::{Material, Roughness};
use crate::scene::surface::SurfacePoint;
use crate::scene::texture::{Color, Textures};

/// Blend trees with more lobes keep the first ones found, the heavier branch of each node first, at the weight of all.
pub const MAX_LAYERS: usize = 8;
/// Indices closer to 1 than this bend nothing; a rough boundary is then treated as a smooth one.
const MIN_ETA_STEP: f32 = 1e-3;

/// What is known on the way down the tree of materials.
#[derive(Clone, Copy)]
struct State {
    weight: f32,
    /// Shading normal on the shape's normal side.
    n: Vec3,
    /// The frame around `n`, once a map has set it.
    frame: Option<Frame>,
    /// Normal before the first map, if there was one.
    unperturbed: Option<Vec3>,
    /// On the back of a two-sided material: the normal of the plane at which the world is mirrored, so that the material
    /// sees its front.
    mirror: Option<Vec3>,
}

impl State {
    /// `v` as the material sees it.
    fn mirrored(&self, v: Vec3) -> Vec3 {
        match self.mirror {
            Some(n) => v - n * (2.0 * n.dot(v)),
            None => v,
        }
    }
}

/// Walks down a tree of materials and collects its lobes.
pub struct Resolver<'a> {
    pub materials: &'a [Material],
    pub textures: Textures<'a>,
    pub at: &'a SurfacePoint,
    pub wo: Vec3,
    pub first: Option<Layer>,
    pub rest: Vec<Layer>,
    /// Weight of the lobes that found no place.
    dropped: f32,
}

impl<'a> Resolver<'a> {
    pub fn new(materials: &'a [Material], textures: Textures<'a>, at: &'a SurfacePoint, wo: Vec3) -> Self {
        Resolver { materials, textures, at, wo, first: None, rest: Vec::new(), dropped: 0.0 }
    }

    /// Collects the lobes of material `id`.
    pub fn run(&mut self, id: u32) {
        let root = State { weight: 1.0, n: self.at.n_shade, frame: None, unperturbed: None, mirror: None };
        self.descend(id, root);
        if self.dropped > 0.0 {
            let layers = || self.first.iter().chain(&self.rest);
            let kept: f32 = layers().map(|l| l.weight).sum();
            let scale = (kept + self.dropped) / kept;
            self.first.iter_mut().chain(&mut self.rest).for_each(|l| l.weight *= scale);
        }
    }

    fn is_full(&self) -> bool {
        self.rest.len() + 1 >= MAX_LAYERS
    }

    fn descend(&mut self, id: u32, state: State) {
        // Here as well as in `push`: a shared subtree could be walked through exponentially often.
        if self.is_full() {
            self.dropped += state.weight;
            return;
        }
        match &self.materials[id as usize] {
            Material::TwoSided { front, back } => {
                if state.mirrored(self.wo).dot(state.n) >= 0.0 {
                    self.descend(*front, state);
                } else {
                    let mirror = match state.mirror {
                        None => Some(state.n),
                        Some(_) => None,
                    };
                    self.descend(*back, State { mirror, ..state });
                }
            }
            Material::Blend { weight, first, second, absorbed } => {
                let w = unit(self.textures.scalar(weight, self.at.uv));
                let total = state.weight * (1.0 - unit(*absorbed));
                let mut branches = [(*first, total * (1.0 - w)), (*second, total * w)];
                if branches[1].1 > branches[0].1 {
                    branches.swap(0, 1);
                }
                for (id, weight) in branches.into_iter().filter(|b| b.1 > 0.0) {
                    self.descend(id, State { weight, ..state });
                }
            }
            Material::Mask { opacity, nested } => {
                let opacity = unit(self.textures.scalar(opacity, self.at.uv));
                let (inside, through) = (state.weight * opacity, state.weight * (1.0 - opacity));
                if inside > 0.0 {
                    self.descend(*nested, State { weight: inside, ..state });
                }
                if through > 0.0 {
                    self.push(&State { weight: through, ..state }, Lobe::Null, false);
                }
            }
            Material::BumpMap { texture, scale, nested } => {
                let slope = self.textures.gradient(*texture, self.at.uv) * *scale;
                let normal = self.bumped(&state, slope.x, slope.y);
                self.descend(*nested, self.perturbed(state, normal));
            }
            Material::NormalMap { texture, nested } => {
                let normal = self.textures.eval(*texture, self.at.uv) * 2.0 - Vec3::ONE;
                self.descend(*nested, self.perturbed(state, normal));
            }
            leaf => {
                let tangents = has_tangents(leaf);
                if let Some(lobe) = self.lobe(leaf) {
                    self.push(&state, lobe, tangents);
                }
            }
        }
    }

    /// The lobe of a material without children.
    fn lobe(&self, material: &Material) -> Option<Lobe> {
        Some(match material {
            Material::Diffuse { reflectance } => Lobe::Lambert(Lambert { reflectance: self.color(reflectance) }),
            Material::RoughDiffuse { reflectance, alpha } => {
                Lobe::OrenNayar(OrenNayar::new(self.color(reflectance), self.textures.scalar(alpha, self.at.uv)))
            }
            Material::Conductor { eta, k, specular_reflectance } => {
                Lobe::Metal(self.metal(*eta, *k, specular_reflectance))
            }
            Material::RoughConductor { eta, k, specular_reflectance, roughness } => Lobe::RoughMetal(RoughMetal {
                metal: self.metal(*eta, *k, specular_reflectance),
                micro: self.micro(roughness),
            }),
            Material::Dielectric { eta, specular_reflectance, specular_transmittance } => {
                Lobe::Glass(self.boundary(*eta, specular_reflectance, specular_transmittance))
            }
            Material::ThinDielectric { eta, specular_reflectance, specular_transmittance } => {
                Lobe::Pane(self.boundary(*eta, specular_reflectance, specular_transmittance))
            }
            Material::RoughDielectric { eta, specular_reflectance, specular_transmittance, roughness } => {
                let boundary = self.boundary(*eta, specular_reflectance, specular_transmittance);
                if (boundary.eta - 1.0).abs() < MIN_ETA_STEP {
                    return Some(Lobe::Glass(boundary));
                }
                let micro = self.micro(roughness);
                Lobe::RoughGlass(RoughBoundary { boundary, micro })
            }
            Material::Plastic { eta, diffuse_reflectance, specular_reflectance, nonlinear } => {
                Lobe::Plastic(Plastic::new(
                    valid_eta(*eta),
                    self.color(diffuse_reflectance),
                    self.color(specular_reflectance),
                    *nonlinear,
                ))
            }
            Material::RoughPlastic { eta, diffuse_reflectance, specular_reflectance, nonlinear, roughness } => {
                Lobe::RoughPlastic(RoughPlastic::new(
                    valid_eta(*eta),
                    self.color(diffuse_reflectance),
                    self.color(specular_reflectance),
                    *nonlinear,
                    self.micro(roughness),
                ))
            }
            Material::Null => Lobe::Null,
            // The caller descends into these.
            Material::TwoSided { .. }
            | Material::Mask { .. }
            | Material::Blend { .. }
            | Material::BumpMap { .. }
            | Material::NormalMap { .. } => return None,
        })
    }

    fn push(&mut self, state: &State, lobe: Lobe, tangents: bool) {
        if self.is_full() {
            self.dropped += state.weight;
            return;
        }
        let mut frame = match state.frame {
            Some(frame) => frame,
            None if tangents => Frame::from_normal_tangent(state.n, self.at.dp_du),
            None => Frame::from_normal(state.n),
        };
        let mut unperturbed = state.unperturbed;
        if state.mirror.is_some() {
            frame = Frame { s: state.mirrored(frame.s), t: state.mirrored(frame.t), n: state.mirrored(frame.n) };
            unperturbed = unperturbed.map(|n| -n);
        }
        let layer = Layer {
            frame,
            weight: state.weight,
            perturbation: unperturbed.map(|n| Perturbation::new(n, frame.n)),
            lobe,
        };
        match self.first {
            None => self.first = Some(layer),
            Some(_) => self.rest.push(layer),
        }
    }

    /// Normal of the height field with the slopes `du`, `dv`, in the shading frame of `state`.
    fn bumped(&self, state: &State, du: f32, dv: f32) -> Vec3 {
        let frame = self.tangent_frame(state);
        let n = frame.n;
        let tilt = |tangent: Vec3, slope: f32| tangent + n * (slope - n.dot(tangent));
        let normal = tilt(self.at.dp_du, du).cross(tilt(self.at.dp_dv, dv)).normalize_or_zero();
        let normal = if normal.dot(self.at.n_geo) < 0.0 { -normal } else { normal };
        frame.to_local(normal)
    }

    /// `state` with the normal `n` (in its shading frame, any length) as the new shading normal.
    fn perturbed(&self, state: State, n: Vec3) -> State {
        let base = self.tangent_frame(&state);
        let wo = base.to_local(state.mirrored(self.wo));
        let n = if wo.z * wo.dot(n) <= 0.0 { Vec3::new(-n.x, -n.y, n.z) } else { n };
        let Some(n) = n.try_normalize() else {
            return state;
        };
        let local = Frame::from_normal_tangent(n, Vec3::X);
        let frame = Frame { s: base.to_world(local.s), t: base.to_world(local.t), n: base.to_world(local.n) };
        State { n: frame.n, frame: Some(frame), unperturbed: Some(state.unperturbed.unwrap_or(state.n)), ..state }
    }

    fn tangent_frame(&self, state: &State) -> Frame {
        state.frame.unwrap_or_else(|| Frame::from_normal_tangent(state.n, self.at.dp_du))
    }

    fn color(&self, color: &Color) -> Rgb {
        valid_color(self.textures.color(color, self.at.uv))
    }

    fn metal(&self, eta: Rgb, k: Rgb, tint: &Color) -> Metal {
        let tint = self.color(tint);
        Metal { eta: valid_color(eta), k: valid_color(k), tint }
    }

    fn boundary(&self, eta: f32, reflectance: &Color, transmittance: &Color) -> Boundary {
        Boundary { eta: valid_eta(eta), reflectance: self.color(reflectance), transmittance: self.color(transmittance) }
    }

    fn micro(&self, r: &Roughness) -> Microfacet {
        let alpha_u = self.textures.scalar(&r.alpha_u, self.at.uv);
        let alpha_v = self.textures.scalar(&r.alpha_v, self.at.uv);
        Microfacet::new(r.distribution, alpha_u, alpha_v)
    }
}

/// True if the lobe depends on the direction of the tangents.
fn has_tangents(material: &Material) -> bool {
    match material {
        Material::RoughConductor { roughness, .. }
        | Material::RoughDielectric { roughness, .. }
        | Material::RoughPlastic { roughness, .. } => roughness.alpha_u != roughness.alpha_v,
        _ => false,
    }
}

/// Clamped to [0, 1]; NaN becomes 0.
fn unit(x: f32) -> f32 {
    clamp_or_low(x, 0.0, 1.0)
}

/// Not negative, finite; pictures may hold anything.
fn valid_color(c: Rgb) -> Rgb {
    c.map(|x| clamp_or_low(x, 0.0, 1e6))
}

/// A usable index; readers refuse others.
fn valid_eta(eta: f32) -> f32 {
    if eta.is_nan() { 1.0 } else { eta.clamp(1e-2, 1e2) }
}
