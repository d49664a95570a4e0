//! The tests of `tactile-gel`, in one program.

mod markers;
mod measured;
mod other_frames;
mod sensors;
mod worlds;
