//! A cache as a file, so that another picture of the same scene starts with it.
//!
//! Layout      [`MAGIC`], [`VERSION`], a [`Fingerprint`] of the scene, the cache's fields in order of their declaration, and a
//!             check sum of all before it. Numbers are little-endian, vectors have their length in front (u64)
//! Refused     other files, other versions, other geometry, other materials and damaged files, each with its own message. Other
//!             lights are told ([`FromFile::same_light`]): [`IrradianceCache::relight`] evaluates the stored hits under them
//! Verified by tests/irradiance_cache.rs: the same bits come back; every kind of wrong file is refused

use super::World;
use super::fingerprint::Fingerprint;
use super::irradiance_cache::IrradianceCache;
use crate::image::atomic;
use crate::math::sampler::hash;
use crate::math::{Frame, Vec2, Vec3};
use arrayvec::ArrayVec;
use std::path::Path;

/// First bytes of the file.
pub const MAGIC: &[u8; 16] = b"dualux irr.cache";
/// Version of the layout.
pub const VERSION: u32 = 6;

/// Why a cache file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CacheFileError {
    /// It cannot be read or written.
    #[error("{0}")]
    Io(String),
    /// It is something else.
    #[error("this is no irradiance cache of dualux")]
    NoCache,
    /// Its layout is another.
    #[error("the cache has version {found} of the file format, this program reads version {VERSION}: make it anew")]
    Version {
        /// Version in the file.
        found: u32,
    },
    /// It belongs to another scene.
    #[error("the cache was made for other geometry than that of this scene")]
    OtherScene,
    /// It belongs to a scene of the same shapes with other materials.
    #[error("the cache was made for other materials or textures than those of this scene")]
    OtherMaterials,
    /// It is cut off or was changed.
    #[error("the cache file is damaged (its check sum does not fit)")]
    Damaged,
    /// Nothing would look into it.
    #[error(
        "this render uses no irradiance cache (it takes --integrator photon, --indirect cache or residual, and more than direct light)"
    )]
    NotUsed,
}

/// A cache that was read.
#[derive(Clone, Debug)]
pub struct FromFile<'a> {
    /// The cache.
    pub cache: IrradianceCache<'a>,
    /// Whether it was made under the lights that the scene has now; else [`IrradianceCache::relight`] is due.
    pub same_light: bool,
}

/// What can be written to a cache file and read again.
pub(super) trait Stored: Sized {
    /// Appends the value.
    fn put(&self, out: &mut Vec<u8>);
    /// Takes the value off the front; `None` if there is too little.
    fn take(from: &mut &[u8]) -> Option<Self>;
}

macro_rules! stored_numbers {
    ($($t:ty)*) => {$(
        impl Stored for $t {
            fn put(&self, out: &mut Vec<u8>) {
                out.extend(self.to_le_bytes());
            }
            fn take(from: &mut &[u8]) -> Option<Self> {
                let (bytes, rest) = from.split_first_chunk()?;
                *from = rest;
                Some(<$t>::from_le_bytes(*bytes))
            }
        }
    )*};
}
stored_numbers!(u8 u32 u64 f32);

/// Implements [`Stored`] field by field.
macro_rules! stored {
    ($t:ty { $($field:ident),* $(,)? }) => {
        impl $crate::transport::cache_file::Stored for $t {
            fn put(&self, out: &mut Vec<u8>) {
                $($crate::transport::cache_file::Stored::put(&self.$field, out);)*
            }
            fn take(from: &mut &[u8]) -> Option<Self> {
                Some(Self { $($field: $crate::transport::cache_file::Stored::take(from)?),* })
            }
        }
    };
}
pub(super) use stored;

stored!(Vec2 { x, y });
stored!(Vec3 { x, y, z });
stored!(Frame { s, t, n });
stored!(Fingerprint { geometry, materials, lights });

impl Stored for bool {
    fn put(&self, out: &mut Vec<u8>) {
        u8::from(*self).put(out);
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        Some(u8::take(from)? != 0)
    }
}

impl Stored for usize {
    fn put(&self, out: &mut Vec<u8>) {
        (*self as u64).put(out);
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        u64::take(from)?.try_into().ok()
    }
}

impl<T: Stored> Stored for Option<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.is_some().put(out);
        if let Some(value) = self {
            value.put(out);
        }
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        Some(if bool::take(from)? { Some(T::take(from)?) } else { None })
    }
}

impl<A: Stored, B: Stored> Stored for (A, B) {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        Some((A::take(from)?, B::take(from)?))
    }
}

impl<T: Stored, const N: usize> Stored for [T; N] {
    fn put(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|v| v.put(out));
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        let values: ArrayVec<T, N> = (0..N).map(|_| T::take(from)).collect::<Option<_>>()?;
        values.into_inner().ok()
    }
}

impl<T: Stored> Stored for Vec<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        self.iter().for_each(|v| v.put(out));
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        let n = usize::take(from)?;
        // Every value has a byte at least: a wrong length takes no memory.
        if n > from.len() {
            return None;
        }
        (0..n).map(|_| T::take(from)).collect()
    }
}

fn check_sum(bytes: &[u8]) -> u64 {
    bytes.chunks(8).fold(bytes.len() as u64, |key, chunk| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        hash(key, u64::from_le_bytes(word))
    })
}

impl<'a> IrradianceCache<'a> {
    /// The cache as the content of a file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        VERSION.put(&mut out);
        Fingerprint::new(self.world()).put(&mut out);
        self.put_fields(&mut out);
        let sum = check_sum(&out);
        sum.put(&mut out);
        out
    }

    /// A cache from the content of a file, for the scene it was made for.
    ///
    /// # Errors
    /// If it is no such file, of another version, of other geometry or materials, or damaged.
    pub fn from_bytes(world: World<'a>, bytes: &[u8]) -> Result<FromFile<'a>, CacheFileError> {
        let mut rest = bytes.strip_prefix(MAGIC.as_slice()).ok_or(CacheFileError::NoCache)?;
        let found = u32::take(&mut rest).ok_or(CacheFileError::Damaged)?;
        if found != VERSION {
            return Err(CacheFileError::Version { found });
        }
        let (content, sum) = bytes.split_last_chunk().ok_or(CacheFileError::Damaged)?;
        if check_sum(content) != u64::from_le_bytes(*sum) {
            return Err(CacheFileError::Damaged);
        }
        let (of_file, own) = (Fingerprint::take(&mut rest).ok_or(CacheFileError::Damaged)?, Fingerprint::new(&world));
        if of_file.geometry != own.geometry {
            return Err(CacheFileError::OtherScene);
        }
        if of_file.materials != own.materials {
            return Err(CacheFileError::OtherMaterials);
        }
        let cache = IrradianceCache::take_fields(world, &mut rest).ok_or(CacheFileError::Damaged)?;
        Ok(FromFile { cache, same_light: of_file.lights == own.lights })
    }

    /// Writes the cache to a file, which appears whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), CacheFileError> {
        atomic::write_file(path, &self.to_bytes()).map_err(|e| CacheFileError::Io(e.to_string()))
    }

    /// Reads a cache that [`Self::save`] wrote, for the scene it was made for.
    ///
    /// # Errors
    /// As [`Self::from_bytes`], and if the file cannot be read.
    pub fn load(world: World<'a>, path: &Path) -> Result<FromFile<'a>, CacheFileError> {
        let bytes = std::fs::read(path).map_err(|e| CacheFileError::Io(format!("{}: {e}", path.display())))?;
        Self::from_bytes(world, &bytes)
    }
}
