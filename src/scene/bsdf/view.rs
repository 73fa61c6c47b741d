//! A surface seen from one direction: the lobe of a material without children, its frame, and what maps of normals do
//! to the frame.
//!
//! Source of the slope of a bump map: Blinn 1978 without the derivative of the normal; of the flip of normals that `wo`
//! cannot see: Schuessler et al. 2017. Conventions as in Mitsuba 3.9.
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

/// Indices closer to 1 than this bend nothing; a rough boundary is then treated as a smooth one.
const MIN_ETA_STEP: f32 = 1e-3;

/// What is known on the way down the tree of materials.
#[derive(Clone, Copy)]
pub struct State {
    /// Share of what follows.
    pub weight: f32,
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
    /// At the root of a tree of materials.
    pub fn new(at: &SurfacePoint) -> Self {
        State { weight: 1.0, n: at.n_shade, frame: None, unperturbed: None, mirror: None }
    }

    /// The part `share` of this.
    pub fn part(self, share: f32) -> Self {
        State { weight: self.weight * share, ..self }
    }

    /// The side of a two-sided material that `wo` is on: true for the front.
    pub fn turned_to(self, wo: Vec3) -> (bool, Self) {
        if self.mirrored(wo).dot(self.n) >= 0.0 {
            return (true, self);
        }
        let mirror = match self.mirror {
            None => Some(self.n),
            Some(_) => None,
        };
        (false, State { mirror, ..self })
    }

    /// `v` as the material sees it.
    fn mirrored(&self, v: Vec3) -> Vec3 {
        match self.mirror {
            Some(n) => v - n * (2.0 * n.dot(v)),
            None => v,
        }
    }
}

/// A surface point, the textures on it and the direction it is seen from.
pub struct View<'a> {
    pub textures: Textures<'a>,
    pub at: &'a SurfacePoint,
    pub wo: Vec3,
}

impl View<'_> {
    /// `lobe`, the lobe of `material`, in its frame.
    pub fn layer(&self, state: &State, material: &Material, lobe: Lobe) -> Layer {
        let mut frame = match state.frame {
            Some(frame) => frame,
            None if has_tangents(material) => Frame::from_normal_tangent(state.n, self.at.dp_du),
            None => Frame::from_normal(state.n),
        };
        let mut unperturbed = state.unperturbed;
        if state.mirror.is_some() {
            frame = Frame { s: state.mirrored(frame.s), t: state.mirrored(frame.t), n: state.mirrored(frame.n) };
            unperturbed = unperturbed.map(|n| -n);
        }
        Layer { frame, weight: state.weight, perturbation: unperturbed.map(|n| Perturbation::new(n, frame.n)), lobe }
    }

    /// The lobe of a material without children, `None` of others.
    #[inline]
    pub fn lobe(&self, material: &Material) -> Option<Lobe> {
        Some(match material {
            Material::Diffuse { reflectance } => Lobe::Lambert(Lambert { reflectance: self.color(reflectance) }),
            Material::RoughDiffuse { reflectance, alpha } => {
                Lobe::OrenNayar(OrenNayar::new(self.color(reflectance), self.textures.scalar(alpha, self.at.uv)))
            }
            Material::Conductor { eta, k, specular_reflectance } => {
                Lobe::Metal(self.metal(eta, k, specular_reflectance))
            }
            Material::RoughConductor { eta, k, specular_reflectance, roughness } => Lobe::RoughMetal(RoughMetal {
                metal: self.metal(eta, k, specular_reflectance),
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

            Material::TwoSided { .. }
            | Material::Mask { .. }
            | Material::Blend { .. }
            | Material::BumpMap { .. }
            | Material::NormalMap { .. } => return None,
        })
    }

    /// Normal of the height field with the slopes `du`, `dv`, in the shading frame of `state`.
    pub fn bumped(&self, state: &State, du: f32, dv: f32) -> Vec3 {
        let frame = self.tangent_frame(state);
        let n = frame.n;
        let tilt = |tangent: Vec3, slope: f32| tangent + n * (slope - n.dot(tangent));
        let normal = tilt(self.at.dp_du, du).cross(tilt(self.at.dp_dv, dv)).normalize_or_zero();
        let normal = if normal.dot(self.at.n_geo) < 0.0 { -normal } else { normal };
        frame.to_local(normal)
    }

    /// `state` with the normal `n` (in its shading frame, any length) as the new shading normal.
    pub fn perturbed(&self, state: State, n: Vec3) -> State {
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

    fn metal(&self, eta: &Color, k: &Color, tint: &Color) -> Metal {
        let index = |c: &Color| valid_color(self.textures.color(c, self.at.uv));
        Metal { eta: index(eta), k: index(k), tint: self.color(tint) }
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
pub fn unit(x: f32) -> f32 {
    clamp_or_low(x, 0.0, 1.0)
}

/// Not negative, finite; pictures may hold anything.
pub fn valid_color(c: Rgb) -> Rgb {
    c.map(|x| clamp_or_low(x, 0.0, 1e6))
}

/// A usable index; readers refuse others.
fn valid_eta(eta: f32) -> f32 {
    if eta.is_nan() { 1.0 } else { eta.clamp(1e-2, 1e2) }
}
