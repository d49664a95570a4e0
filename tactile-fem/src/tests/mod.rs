//! Convergence of the elements and of contact, against exact solutions.

mod contact;
mod elements;
mod indentation;
mod press;
mod squeeze;
mod stick;
