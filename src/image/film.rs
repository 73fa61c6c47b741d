//! The film.
