//! Light transport algorithms.
