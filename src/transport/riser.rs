//! What rises from a surface: how far along it light may be carried over.
//!
//! A record of the irradiance cache, or the kernel of a photon, spreads what is known at one place over the surface around. It must not
//! go through what stands there. So in a few directions along the surface the nearest thing that rises is noted, as a half-plane in
//! the tangent plane; a point in the sectors beside that direction lies behind it or not.

use super::cache_file::stored;
use crate::math::Vec2;

/// Directions along the surface in which it is known how far one may reach.
pub const SECTORS: usize = 16;

/// A surface that rises from the plane around a place: points with `normal . x < offset` lie behind it. In the tangent plane,
/// relative to the place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Riser {
    /// Its normal, projected and normalised.
    pub normal: Vec2,
    /// Of its trace in the plane; not positive unless the place itself is behind it.
    pub offset: f32,
}

stored!(Riser { normal, offset });

impl Riser {
    /// Nothing rises.
    pub const NONE: Riser = Riser { normal: Vec2::ZERO, offset: f32::NEG_INFINITY };
}

/// The sector of a direction in the tangent plane; sectors have equal shares of |x| + |y| = 1.
pub fn sector(v: Vec2) -> usize {
    let t = v.y / (v.x.abs() + v.y.abs());
    let turn = if v.x < 0.0 {
        2.0 - t
    } else if v.y < 0.0 {
        4.0 + t
    } else {
        t
    };
    ((turn * (SECTORS as f32 / 4.0)) as usize).min(SECTORS - 1)
}
