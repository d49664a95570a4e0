//! Benches of the workspace: see the files beside this one and `cargo bench -p tactile-benches
//! --bench NAME`.
