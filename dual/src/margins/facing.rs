//! Sides of planes: horizon of a receiver, back of an emitter, silhouettes of meshes.
//!
//! `m = n.d`: degree 1 in d, exact at order 1 wherever d is affine in p, also with a moving origin.

use crate::real::{Real, Scalar};
use crate::vec3::Vec3;

/// `n.d`. With n the receiver's normal and d towards the light: positive above the horizon. With n the *negative* normal of an
/// emitter: positive in front of it. Units: |n| |d|.
#[inline(always)]
pub fn facing<T: Real>(d: Vec3<T>, n: Vec3<T::Primitive>) -> T {
    Vec3::lift(n).dot(d)
}

/// True if an edge through point `x`, between faces with normals `n1` and `n2` (same orientation), is a silhouette
/// from `o`: one face turns towards o, the other away. A face seen exactly edge-on counts as turned away.
#[inline(always)]
pub fn is_silhouette<F: Scalar>(o: Vec3<F>, x: Vec3<F>, n1: Vec3<F>, n2: Vec3<F>) -> bool {
    let v = o - x;
    (n1.dot(v) > F::zero()) != (n2.dot(v) > F::zero())
}

/// The same for a whole range of origins `o + sum p_k o_k`, p in `[-1,1]`^N: false only if the edge is a silhouette from none.
///
/// Conservative: each face's turning is a linear condition whose range over the origins is known exactly; that
/// "towards" for one face and "away" for the other occur at the *same* origin is not checked.
pub fn may_be_silhouette<F: Scalar, const N: usize>(
    o: Vec3<F>,
    o_p: &[Vec3<F>; N],
    x: Vec3<F>,
    n1: Vec3<F>,
    n2: Vec3<F>,
) -> bool {
    let interval = |n: Vec3<F>| {
        let centre = n.dot(o - x);
        let reach = o_p.iter().fold(F::zero(), |r, v| r + n.dot(*v).abs());
        (centre + reach > F::zero(), centre - reach <= F::zero())
    };
    let ((front1, back1), (front2, back2)) = (interval(n1), interval(n2));
    (front1 && back2) || (back1 && front2)
}
