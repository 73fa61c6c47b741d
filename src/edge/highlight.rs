//! Borders of highlights: where the light's mirror image leaves a rough surface's lobe.
//!
//! Margin: `(n.H)^2 - c^2 n.n H.H`, H = d + |d| w, of the half vector between light (d) and viewer (w): `dualux_dual::margins::half_vector`,
//! with the cosine c at which the distribution of microfacet normals falls to [`TAU`] of its peak. GGX: METHODS 3.B. Beckmann,
//! `D ~ exp(-tan^2 / alpha^2) / cos^4`: `c^2 = 1 / (1 + alpha^2 x)`, x from `x = ln(1 / tau) + 2 ln(1 + alpha^2 x)`.
//! The root in H makes it a prediction to second order; the light is looked at in `PARTS`^2 parts.
//!
//! Not handled: textured and anisotropic roughness (its larger value counts), masks and mixtures, Fresnel and masking factors.

use super::kinds::{Events, Kinds};
use super::outline::Outline;
use super::view::{D2, to_dual};
use super::{EdgeDetector, NOTHING};
use crate::scene::material::{Distribution, Roughness};
use crate::scene::{Geometry, Material, Scalar, SurfacePoint};
use dualux_dual::{Expansion, Family, Jet, Vec3, margins};

/// Fraction of the lobe's peak that is its border.
pub const TAU: f64 = 0.1;

/// Parts of a light along each side.
const PARTS: usize = 4;

impl EdgeDetector<'_> {
    /// Whether the border of the lobe in which the surface point, seen from direction `wo`, reflects light may lie inside the light
    /// `light`, a shape. `None` for surfaces without such a border, and where it lies outside.
    pub fn highlight(&self, light: u32, at: &SurfacePoint, wo: crate::math::Vec3) -> Option<Events> {
        let outside = at.n_geo.dot(wo) > 0.0;
        let cos = self.lobe_border(self.scene.shapes[at.shape as usize].material, outside)?;
        let n = to_dual(if outside { at.n_shade } else { -at.n_shade }.as_dvec3());
        let w = to_dual(wo.normalize().as_dvec3());
        let p = at.p.as_dvec3();
        let mut nearest = None::<f64>;
        let mut look = |outline: Outline| {
            let [x, y] = outline.half.map(to_dual);
            let whole = Family::towards(to_dual(p), to_dual(outline.centre), [x, y]);
            let half = 1.0 / PARTS as f64;
            for i in 0..PARTS * PARTS {
                let middle = [i % PARTS, i / PARTS].map(|k| (2 * k + 1) as f64 * half - 1.0);
                if outline.domain.cuts().iter().any(|l| super::view::at(l, middle) < 0.0) {
                    continue;
                }
                let ray = whole.cell(middle, [half; 2]).fixed_ray::<D2>();
                let m = margins::half_vector(ray.d, Vec3::lift(w), Vec3::lift(n), cos).expansion();
                let m = if self.settings.order < 2 { m.first_order() } else { m };
                if self.settings.test.flags(&m) {
                    let distance = distance(&m, middle, half);
                    nearest = Some(nearest.map_or(distance, |d| d.min(distance)));
                }
            }
        };
        match &self.scene.shapes[light as usize].geometry {
            Geometry::Rectangle(r) => look(Outline::whole(r.center.as_dvec3(), [r.ex.as_dvec3(), r.ey.as_dvec3()])),
            Geometry::Disk(d) => look(Outline::whole(d.center.as_dvec3(), [d.ex.as_dvec3(), d.ey.as_dvec3()])),
            Geometry::Sphere(s) => look(Outline::sphere(p, s.center.as_dvec3(), f64::from(s.radius))?),
            Geometry::Cylinder(c) => look(Outline::cylinder(p, c)?),
            Geometry::Mesh(m) if m.triangles.len() > super::light::MOST_TRIANGLES => return None,
            Geometry::Mesh(m) => {
                (0..m.triangles.len() as u32).for_each(|k| look(Outline::triangle(m.corners(k).map(|v| v.as_dvec3()))));
            }
        }
        nearest.map(|distance| Events { kinds: Kinds::HIGHLIGHT, distance, ..NOTHING })
    }

    /// Cosine between normal and half vector at the border of a material's lobe.
    fn lobe_border(&self, material: u32, outside: bool) -> Option<f64> {
        match &self.scene.materials[material as usize] {
            Material::RoughConductor { roughness, .. } | Material::RoughPlastic { roughness, .. } if outside => {
                border(roughness)
            }
            Material::RoughDielectric { roughness, .. } => border(roughness),
            Material::TwoSided { front, back } => self.lobe_border(if outside { *front } else { *back }, true),
            Material::BumpMap { nested, .. } | Material::NormalMap { nested, .. } => self.lobe_border(*nested, outside),
            _ => None,
        }
    }
}

/// From the footprint's middle, for a part of it.
fn distance(m: &Expansion<f64, 2>, middle: [f64; 2], half: f64) -> f64 {
    let g2 = m.gradient[0] * m.gradient[0] + m.gradient[1] * m.gradient[1];
    let s = if g2 > 0.0 { -m.value / g2 } else { 0.0 };
    let at = |k: usize| middle[k] + half * (s * m.gradient[k]).clamp(-1.0, 1.0);
    at(0).hypot(at(1))
}

fn border(r: &Roughness) -> Option<f64> {
    let (Scalar::Constant(u), Scalar::Constant(v)) = (&r.alpha_u, &r.alpha_v) else { return None };
    let alpha = f64::from(u.max(*v));
    match r.distribution {
        Distribution::Ggx => margins::ggx_border(alpha, TAU),
        Distribution::Beckmann => {
            // A contraction for the roughness of anything that has a highlight.
            let x = (0..30).fold(0.0, |x: f64, _| (1.0 / TAU).ln() + 2.0 * (alpha * alpha * x).ln_1p());
            (alpha < 1.0).then(|| (1.0 / (1.0 + alpha * alpha * x)).sqrt())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_the_border_the_distribution_is_the_stated_part_of_its_peak() {
        for alpha in [0.05, 0.2, 0.5] {
            let r = |distribution| Roughness {
                distribution,
                alpha_u: Scalar::Constant(alpha as f32),
                alpha_v: Scalar::Constant(alpha as f32),
            };
            let alpha = f64::from(alpha as f32);
            let c2 = border(&r(Distribution::Beckmann)).unwrap().powi(2);
            let d = (-(1.0 - c2) / (c2 * alpha * alpha)).exp() / (c2 * c2);
            assert!((d - TAU).abs() < 1e-6, "Beckmann {alpha}: {d}");
            let ggx = |c2: f64| (c2 * (alpha * alpha - 1.0) + 1.0).powi(-2);
            if let Some(c) = border(&r(Distribution::Ggx)) {
                assert!((ggx(c * c) / ggx(1.0) - TAU).abs() < 1e-6, "GGX {alpha}");
            }
        }
    }
}
