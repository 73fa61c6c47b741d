//! Tests of direct light.
