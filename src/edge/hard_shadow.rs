//! Edges of hard shadows: does what hides a light without extent change over a patch of a surface?
//!
//! The family runs the other way round than for lamps: from the light (one origin) or along it (one direction) to the patch, a
//! parallelogram round the lit point, so that shadow edges of polygons and quadrics on a plane are found exactly. An edge that
//! something else covers casts no shadow. What is closer to the patch than a margin is left out: on curved surfaces the patch is
//! only their tangent.

use super::EdgeDetector;
use super::gather::Facet;
use super::kinds::LightVerdict;
use super::view::{View, to_dual};
use crate::math::DVec3;
use dualux_dual::Family;

/// A light without extent.
#[derive(Clone, Copy, Debug)]
pub enum PointOrDirection {
    /// Position.
    Point(DVec3),
    /// Unit direction in which the light travels.
    Parallel(DVec3),
}

/// The parallelogram p + x h0 + y h1, h0 and h1 the half edges, x and y in `[-1,1]`.
#[derive(Clone, Copy, Debug)]
pub struct ShadowPatch {
    /// Centre.
    pub p: DVec3,
    /// Half edges.
    pub half: [DVec3; 2],
    /// The facet it lies on.
    pub facet: Facet,
    /// Distance from the patch, along the light, within which nothing counts.
    pub margin: f64,
}

impl EdgeDetector<'_> {
    /// What of the patch the light reaches: `Visible` and `Blocked` are without edges. `lamp`: a facet that is the light.
    pub fn hard_shadow(&self, light: PointOrDirection, patch: &ShadowPatch, lamp: Option<Facet>) -> LightVerdict {
        let [x, y] = patch.half.map(to_dual);
        let view = match light {
            PointOrDirection::Point(o) => {
                let family = Family::towards(to_dual(o), to_dual(patch.p), [x, y]);
                let end = 1.0 - patch.margin / (patch.p - o).length();
                View::new(family, [1e-6, end])
            }
            PointOrDirection::Parallel(d) => {
                let (centre, radius) = self.scene.bounds;
                let far = (patch.p - centre.as_dvec3()).length() + 2.0 * f64::from(radius);
                let zero = to_dual(DVec3::ZERO);
                let family = Family::new(to_dual(patch.p - d * far), [x, y], to_dual(d), [zero; 2]);
                View::new(family, [0.0, far - patch.margin])
            }
        };
        let lamp = lamp.unwrap_or(Facet::NONE);
        // A patch seen edge-on by the light has no shadow edge on it but its own horizon, where the light is 0.
        view.filter(|v| v.t[1] > v.t[0])
            .map_or(LightVerdict::Blocked, |view| self.shadow(&view, None, [patch.facet, lamp, lamp], None, false))
    }
}
