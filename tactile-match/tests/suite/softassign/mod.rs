//! Annealed softassign: what it finds, and how it is called.
mod answers;
mod calls;
