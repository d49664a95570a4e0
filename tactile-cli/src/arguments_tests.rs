//! Numbers on the command line.
use super::*;

#[test]
fn arguments_are_checked() {
    assert_eq!(direction("0, 0,1"), Ok([0.0, 0.0, 1.0]));
    assert!(direction("0,0").is_err() && direction("0,nan,1").is_err());
    assert_eq!(one_or_two("20"), Ok([20.0, 20.0]));
    assert!(one_or_two("20,0").is_err() && positive("inf").is_err());
}
