//! Photon differentials: how the neighbourhood of a photon spreads along its way.
//!
//! ```text
//! g_k = dP / dp_k in the tangent plane,  Sigma = sum_k g_k g_k^T / 3  +  blur       p_k uniform in [-1, 1]: variance 1/3
//! blur: variance b^2 across the beam, b += angle t along a segment of length t
//! ```
//!
//! Up to the first diffuse scattering the derivatives by the parameters of emission ride along as f64 duals: transfer, normals (interpolated
//! on smooth meshes), reflection and refraction by the chain rule on the primitive that was hit. A rough facet turns with the surface:
//! its normal is the half vector, its derivative that of the shading normal. Rough scattering adds blur. At a diffuse scattering the duals end:
//! what follows is a cone, with the footprint so far as its base and an opening angle of the directions one photon stands for.
//! Where photons of the neighbourhood are scattered by chance, those that go the same way are fewer, with probability q: their cells
//! are larger, Sigma / q for two parameters, Sigma / sqrt(q) for four (METHODS 3.B: n_c^(-2/d)).
//!
//! Source: Igehy 1999; Schjoth et al. 2007, "Photon Differentials"; Suykens & Willems 2001 for the cone behind a diffuse bounce.
//! Bias: none here: footprints steer kernels only. Not handled: the derivatives of bump and normal maps; folds (second order).
//! Verified by `tests/chains.rs`: the whole chain against central differences of traced rays.

use crate::edge::predicted::D1;
use crate::edge::surface;
use crate::edge::view::{from_dual, to_dual};
use crate::emission::{EmittedRay, MOST_PARAMETERS};
use crate::math::{DVec3, Frame, Vec3};
use crate::scene::{Shape, SurfacePoint};
use arrayvec::ArrayVec;
use dualux_dual::{Family, Jet as _, Ray, face_against, reflect, refract};

/// Standard deviation of the directions that a photon behind a rough facet stands for, in units of the roughness. The lobe itself has
/// sqrt 2 per axis; half of it keeps most of its shape.
const GLOSSY_SHARE: f64 = 0.7;
/// Smallest cosine by which a beam's blur is stretched on a surface.
const GRAZING: f64 = 0.1;

/// A ray's neighbourhood in `N` parameters.
#[derive(Clone, Debug)]
pub struct Differential<const N: usize> {
    /// The ray with its derivatives; `None` behind a diffuse scattering.
    ray: Option<Ray<D1<N>>>,
    /// Standard deviation across the beam, on top of the derivatives.
    blur: f64,
    /// Growth of `blur` per length.
    angle: f64,
    /// Factor on Sigma for neighbours lost by chance.
    thinning: f64,
}

/// Where a photon's ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct Meeting<const N: usize> {
    /// Point and shading normal with derivatives, while they are known.
    dual: Option<(dualux_dual::Vec3<D1<N>>, dualux_dual::Vec3<D1<N>>)>,
}

/// Parameters that an emitted ray depends on, in order. A point light has two, whichever they are, a lamp four.
pub fn parameters(emitted: &EmittedRay) -> ArrayVec<usize, MOST_PARAMETERS> {
    let spread = &emitted.spread;
    (0..MOST_PARAMETERS).filter(|&k| spread.o[k] != Vec3::ZERO || spread.d[k] != Vec3::ZERO).collect()
}

impl<const N: usize> Differential<N> {
    /// The neighbourhood that an emitted photon stands for, of which `N` at most of the [`parameters`] are kept.
    pub fn new(emitted: &EmittedRay, parameters: &[usize]) -> Self {
        let by = |v: &[Vec3; MOST_PARAMETERS]| {
            std::array::from_fn(|k| to_dual(parameters.get(k).map_or(Vec3::ZERO, |&p| v[p]).as_dvec3()))
        };
        let (o, d) = (to_dual(emitted.o.as_dvec3()), to_dual(emitted.d.as_dvec3()));
        let family = Family::<f64, N>::new(o, by(&emitted.spread.o), d, by(&emitted.spread.d));
        Differential { ray: Some(family.ray()), blur: 0.0, angle: 0.0, thinning: 1.0 }
    }

    /// The beam grows along a segment of length `t`.
    pub fn advance(&mut self, t: f32) {
        self.blur += self.angle * f64::from(t);
    }

    /// Where the ray meets the surface that it has been advanced to.
    pub fn meet(&self, shape: &Shape, at: &SurfacePoint) -> Meeting<N> {
        Meeting { dual: self.ray.as_ref().map(|ray| surface::meet(shape, ray, at)) }
    }

    /// Principal axes of the footprint at a meeting with `at`: standard deviations, the longer one first. Infinite if nothing is known.
    pub fn axes(&self, meeting: &Meeting<N>, at: &SurfacePoint, wi: Vec3) -> [Vec3; 2] {
        let frame = Frame::from_normal(at.n_geo);
        let (s, t) = (frame.s.as_dvec3(), frame.t.as_dvec3());
        let [mut xx, mut xy, mut yy] = [0.0; 3];
        let mut add = |x: f64, y: f64, by: f64| {
            xx += by * x * x;
            xy += by * x * y;
            yy += by * y * y;
        };
        if let Some((p, _)) = &meeting.dual {
            let [px, py, pz] = p.to_array().map(|c| c.gradient());
            for k in 0..N {
                let g = DVec3::new(px[k], py[k], pz[k]);
                add(g.dot(s), g.dot(t), self.thinning / 3.0);
            }
        }
        if self.blur > 0.0 {
            let b2 = self.blur * self.blur;
            let (x, y) = (f64::from(wi.dot(frame.s)), f64::from(wi.dot(frame.t)));
            let cos = f64::from(wi.dot(at.n_geo).abs()).max(GRAZING);
            let sin2 = x * x + y * y;
            // Along the plane of incidence a cross-section is stretched by 1 / cos.
            add(1.0, 0.0, b2);
            add(0.0, 1.0, b2);
            if sin2 > 0.0 {
                add(x, y, b2 * (1.0 / (cos * cos) - 1.0) / sin2);
            }
        }
        let ([x, y], [long, short]) = principal(xx, xy, yy);
        let (x, y) = (x as f32, y as f32);
        let sigma = [(frame.s * x + frame.t * y) * long as f32, (frame.t * x - frame.s * y) * short as f32];
        if sigma.iter().all(|v| v.is_finite()) { sigma } else { [Vec3::INFINITY; 2] }
    }

    /// The photon goes on towards `wi` by a mirror or boundary (`eta`: index behind over index before, 1 without refraction), chosen with
    /// probability `q`; `alpha` is the roughness of the facets, 0 if smooth.
    pub fn scatter(&mut self, meeting: &Meeting<N>, wi: Vec3, eta: f32, alpha: f32, q: f32) {
        self.thin(q);
        self.angle += GLOSSY_SHARE * f64::from(alpha);
        let (Some(ray), Some((p, n))) = (self.ray, meeting.dual) else { return };
        let d = ray.d;
        let (before, after) = (from_dual(d.re()), wi.as_dvec3());
        // The half vector of reflection or refraction: the normal that really bent the ray.
        let straight = (after - before).length_squared() < 1e-12;
        let half = if eta == 1.0 { after - before } else { after * f64::from(eta) - before };
        let Some(half) = half.try_normalize().filter(|_| !straight) else {
            self.ray = Some(Ray::new(p, d));
            return;
        };
        let n = face_against(n, d);
        let half = if half.dot(before) > 0.0 { -half } else { half };
        let n = turned(n, half);
        let bent = if eta == 1.0 { Some(reflect(d, n)) } else { refract(d, n, 1.0 / f64::from(eta)).direction };
        self.ray = bent.map(|d| Ray::new(p, d));
    }

    /// The photon is scattered diffusely after its footprint was `sigma`: a cone of half angle `angle` (standard deviation) goes on.
    pub fn diffuse(&mut self, sigma: [Vec3; 2], widen: f64, angle: f64) {
        self.ray = None;
        let area = f64::from(sigma[0].length()) * f64::from(sigma[1].length());
        self.blur = widen * area.sqrt();
        self.angle = angle;
        self.thinning = 1.0;
    }

    /// Neighbours go the same way with probability `q` only.
    pub fn thin(&mut self, q: f32) {
        self.thinning *= f64::from(q.max(1e-3)).powf(-2.0 / N as f64);
    }
}

/// `n` with its value replaced by the unit vector `to`, its derivatives kept perpendicular to that.
fn turned<const N: usize>(n: dualux_dual::Vec3<D1<N>>, to: DVec3) -> dualux_dual::Vec3<D1<N>> {
    let [nx, ny, nz] = n.to_array().map(|c| c.gradient());
    let mut g = [[0.0; N]; 3];
    for k in 0..N {
        let v = DVec3::new(nx[k], ny[k], nz[k]);
        let v = v - to * to.dot(v);
        [g[0][k], g[1][k], g[2][k]] = v.to_array();
    }
    dualux_dual::vec3(D1::jet(to.x, g[0]), D1::jet(to.y, g[1]), D1::jet(to.z, g[2]))
}

/// Principal axis (unit) of the symmetric matrix (xx, xy; xy, yy) and the roots of its eigenvalues, the greater one first.
fn principal(xx: f64, xy: f64, yy: f64) -> ([f64; 2], [f64; 2]) {
    let mean = 0.5 * (xx + yy);
    let half = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
    let long = mean + half;
    // The product of the roots is the determinant: no cancellation in the smaller one.
    let det = (xx * yy - xy * xy).max(0.0);
    let short = if long > 0.0 { det / long } else { 0.0 };
    // Two columns of M - short I are parallel to the axis; the longer one is taken.
    let (a, b) = ([xx - (mean - half), xy], [xy, yy - (mean - half)]);
    let v = if a[0].abs() >= b[1].abs() { a } else { b };
    let length = v[0].hypot(v[1]);
    let axis = if length > 0.0 { [v[0] / length, v[1] / length] } else { [1.0, 0.0] };
    (axis, [long.sqrt(), short.sqrt()])
}
