//! Annealed softassign: results and calls.
mod answers;
mod calls;
