//! What the runtime asks of the machine: memory and input files.
//!
//! Promises that a large need for memory is an error with its size before anything is allocated ([`memory`]), that only
//! regular files of a known size are read ([`input`]), and that a scene reads only from folders it may ([`reading`]).
//! Does not write files, and knows nothing of meshes, matrices and scenes.
#![forbid(unsafe_code)]

pub mod input;
pub mod memory;
pub mod reading;
