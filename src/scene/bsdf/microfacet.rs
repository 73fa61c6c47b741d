//! Microfacet distributions: Beckmann and GGX, anisotropic, with sampling of visible normals.
//!
//! Local space, normal = +z; D is a density of normals per solid angle and projected area (int D(m) m.z dm = 1).
//! Pdf measure of `sample`: D(m) max(0, v.m) / A(v) per solid angle of m, with `projected_area` A.
//! Source: Walter et al. 2007 (D, G1, the rational fit of Beckmann's G1); Heitz 2014, "Understanding the
//! Masking-Shadowing Function" (anisotropy, projected area); GGX normals: Dupuy & Benyoub 2023, "Sampling Visible GGX
//! Normals with Spherical Caps"; Beckmann normals: Heitz & d'Eon 2014, the slope equation solved in erf space as in
//! Jakob 2014. Shadowing and masking are separable, G = G1(wo) G1(wi), as in Mitsuba.
//! G1 of Beckmann in f is Walter's fit (off by up to 0.35 %), so that values agree with Mitsuba; the pdf uses the exact
//! projected area, so that it is the density that is really sampled.
//! Not handled: multiple scattering between facets (its energy is lost).

use crate::math::{Vec2, Vec3};
use crate::scene::material::Distribution;
use std::f32::consts::PI;

use super::clamp_or_low;
use super::erf::{erf, erf_inv};

/// Smaller roughness is raised to this: f32 resolves no sharper peak.
pub const MIN_ALPHA: f32 = 1e-4;
/// Larger roughness is lowered to this: the distribution is then all but one of grazing facets.
const MAX_ALPHA: f32 = 1e2;

/// A distribution of facet normals.
#[derive(Clone, Copy, Debug)]
pub struct Microfacet {
    distribution: Distribution,
    alpha_u: f32,
    alpha_v: f32,
}

impl Microfacet {
    /// The distribution with the given roughness along the two tangents; clamped to what can be computed.
    pub fn new(distribution: Distribution, alpha_u: f32, alpha_v: f32) -> Self {
        let clamp = |a: f32| clamp_or_low(a, MIN_ALPHA, MAX_ALPHA);
        Microfacet { distribution, alpha_u: clamp(alpha_u), alpha_v: clamp(alpha_v) }
    }

    /// The family.
    pub fn distribution(&self) -> Distribution {
        self.distribution
    }

    /// The smaller of the two roughnesses.
    pub fn min_alpha(&self) -> f32 {
        self.alpha_u.min(self.alpha_v)
    }

    /// Geometric mean of the two roughnesses.
    pub fn mean_alpha(&self) -> f32 {
        (self.alpha_u * self.alpha_v).sqrt()
    }

    /// D(m): density of facet normals; 0 below the horizon.
    pub fn d(&self, m: Vec3) -> f32 {
        if m.z <= 0.0 {
            return 0.0;
        }
        let (x, y) = (m.x / self.alpha_u, m.y / self.alpha_v);
        let slope = x * x + y * y;
        let cos2 = m.z * m.z;
        let area = PI * self.alpha_u * self.alpha_v;
        let d = match self.distribution {
            Distribution::Beckmann => (-slope / cos2).exp() / (area * cos2 * cos2),
            Distribution::Ggx => {
                let q = slope + cos2;
                1.0 / (area * q * q)
            }
        };
        // Far out in the tail the quotients may under- or overflow.
        if d.is_finite() && d * m.z > 1e-20 { d } else { 0.0 }
    }

    /// Share of the facets of normal m facing `v` that `v` sees; `v` may lie on either side.
    pub fn g1(&self, v: Vec3, m: Vec3) -> f32 {
        if v.dot(m) * v.z <= 0.0 {
            return 0.0;
        }
        let (z, r) = (v.z.abs(), self.stretched_radius(v));
        match self.distribution {
            Distribution::Ggx => 2.0 * z / (z + (z * z + r * r).sqrt()),
            Distribution::Beckmann => {
                if z >= 1.6 * r {
                    return 1.0;
                }
                let a = z / r;
                (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a)
            }
        }
    }

    /// A normal as seen from `v` (above the horizon).
    pub fn sample(&self, v: Vec3, u: Vec2) -> Option<Vec3> {
        let stretched = Vec3::new(self.alpha_u * v.x, self.alpha_v * v.y, v.z).normalize();
        let m = match self.distribution {
            Distribution::Ggx => {
                // Reflect at the hemisphere's cap: uniform in z down to -v.z.
                let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
                let r = (1.0 - z * z).max(0.0).sqrt();
                let (sin, cos) = (2.0 * PI * u.x).sin_cos();
                stretched + Vec3::new(r * cos, r * sin, z)
            }
            Distribution::Beckmann => {
                let x = visible_slope(stretched.z, u.x);
                let y = erf_inv(2.0 * u.y - 1.0);
                let r = stretched.x.hypot(stretched.y);
                let (cos, sin) = if r > 1e-7 { (stretched.x / r, stretched.y / r) } else { (1.0, 0.0) };
                Vec3::new(-(cos * x - sin * y), -(sin * x + cos * y), 1.0)
            }
        };
        let m = Vec3::new(self.alpha_u * m.x, self.alpha_v * m.y, m.z.max(0.0));
        m.try_normalize().filter(|m| m.z > 0.0)
    }

    /// Area of all facets seen from `v`, projected on the plane normal to `v`, per unit area of the surface:
    /// cos / G1 with the exact G1.
    pub fn projected_area(&self, v: Vec3) -> f32 {
        let (z, r) = (v.z, self.stretched_radius(v));
        let area = match self.distribution {
            Distribution::Ggx => 0.5 * (z + (z * z + r * r).sqrt()),
            // Beyond 3.5 the exact expression is z in f32.
            Distribution::Beckmann if z >= 3.5 * r => z,
            Distribution::Beckmann => {
                let a = z / r;
                0.5 * (z * (1.0 + erf(a)) + r * (-a * a).exp() / PI.sqrt())
            }
        };
        area.max(f32::MIN_POSITIVE)
    }

    fn stretched_radius(&self, v: Vec3) -> f32 {
        let (x, y) = (self.alpha_u * v.x, self.alpha_v * v.y);
        (x * x + y * y).sqrt()
    }
}

/// Slope along the plane of view of a facet of unit roughness seen under the cosine `cos`: inverts
/// C(x) = cos (1 + erf x) + sin exp(-x^2) / sqrt(pi), x up to cot, at the share `u` of its total.
fn visible_slope(cos: f32, u: f32) -> f32 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let side = sin / PI.sqrt();
    // All in b = erf(x), where C is nearly a parabola; its derivative is cos - x sin >= 0.
    let (mut low, mut high) = if cos < 4.0 * sin { (-1.0, erf(cos / sin)) } else { (-1.0, 1.0) };
    let cot2 = if sin > 0.0 { (cos / sin) * (cos / sin) } else { f32::INFINITY };
    let target = u * (cos * (1.0 + high) + side * (-cot2).exp());
    let mut b = low + (high - low) * u;
    let mut x = erf_inv(b);
    for _ in 0..24 {
        let error = cos * (1.0 + b) + side * (-x * x).exp() - target;
        if error.abs() < 1e-6 * (cos + side) {
            break;
        }
        if error > 0.0 {
            high = b;
        } else {
            low = b;
        }
        let newton = b - error / (cos - x * sin);
        b = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        x = erf_inv(b);
    }
    x
}

/// Mirror image of `v` at the facet normal `m`.
pub fn reflect(v: Vec3, m: Vec3) -> Vec3 {
    m * (2.0 * v.dot(m)) - v
}
