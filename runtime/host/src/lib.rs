//! What the runtime needs from the machine: memory and input files.
//!
//! Promises: a large allocation that does not fit is an error with its size before anything is allocated ([`memory`]);
//! only regular files of a known size are read ([`input`]); a scene reads only from allowed folders ([`reading`]); ranks
//! that solve one problem together find one result ([`team`]) and keep copies of each other's numbers ([`halo`]). Does not
//! write files, and knows nothing of meshes, matrices and scenes.
#![deny(unsafe_code)]

pub mod halo;
pub mod input;
pub mod memory;
pub mod reading;
pub mod team;
