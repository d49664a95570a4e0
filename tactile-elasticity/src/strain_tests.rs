use super::*;

#[test]
fn cancelling_products_keep_their_difference() {
    // (1 + u)(1 - u) - 1 = -u², far below the rounding of the product itself.
    let u = 2f64.powi(-40);
    let difference = DoubleDouble::zero()
        .add_product(1.0 + u, 1.0 - u)
        .add(-1.0)
        .value();
    assert_eq!(difference, -u * u);
    let triple = DoubleDouble::zero()
        .add_triple(3.0, 5.0, 7.0)
        .add(-105.0)
        .value();
    assert_eq!(triple, 0.0);
}
