//! Footprints of pixels: rectangles of the film, seen through a pinhole, by parallel projection, or through a lens.

use super::view::{View, to_dual};
use crate::scene::Camera;
use dualux_dual::Family;

/// The rays of a rectangle of film.
#[derive(Clone, Copy, Debug)]
pub enum PixelFamily {
    /// Pinhole or orthographic camera: exact.
    Exact(View),
    /// Thin lens: parameters 0 and 1 move over the film, 2 and 3 over the square round the lens.
    Lens(Family<f64, 4>, [f64; 2]),
}

/// The rays through the film's rectangle around `centre` with half sizes `half`, in pixels of the full image. `None` where the
/// camera sees it edge-on.
#[inline(always)] // large values, returned where they are used
pub fn family(camera: &Camera, centre: [f64; 2], half: [f64; 2]) -> Option<PixelFamily> {
    let p = camera.patch(centre, half);
    let [ofx, ofy] = p.o_film.map(to_dual);
    let [dfx, dfy] = p.d_film.map(to_dual);
    let [olx, oly] = p.o_lens.map(to_dual);
    let [dlx, dly] = p.d_lens.map(to_dual);
    let (o, d) = (to_dual(p.o), to_dual(p.d));
    if p.o_lens == [crate::math::DVec3::ZERO; 2] {
        return View::new(Family::new(o, [ofx, ofy], d, [dfx, dfy]), p.t).map(PixelFamily::Exact);
    }
    Some(PixelFamily::Lens(Family::new(o, [ofx, ofy, olx, oly], d, [dfx, dfy, dlx, dly]), p.t))
}
