//! The tests of `tactile-gel`, in a single program.

mod dark;
mod dots;
mod markers;
mod measured;
mod other_frames;
mod sensors;
mod worlds;
