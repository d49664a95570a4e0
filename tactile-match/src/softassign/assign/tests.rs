//! Tests of the building blocks.

mod soft_assign {
    use super::super::*;

    fn scene() -> (Vec<[f64; 2]>, SoftAssignment<2>) {
        let targets: Vec<[f64; 2]> = (0..41)
            .map(|i| [f64::from(i) * 0.1, f64::from(i * i % 7) * 0.2])
            .collect();
        let mut soft = SoftAssignment {
            faintest: 1e-6,
            ..SoftAssignment::default()
        };
        soft.set_targets(&targets);
        (
            targets
                .iter()
                .take(37)
                .map(|t| [t[0] + 0.02, t[1] - 0.01])
                .collect(),
            soft,
        )
    }

    fn plain(variance: f64) -> Gaussian {
        Gaussian {
            variance,
            sharpness: 1.0,
        }
    }

    #[test]
    fn rows_and_columns_sum_to_one_with_their_slack() {
        let (warped, mut soft) = scene();
        soft.affinities(&warped, plain(0.02), 1e-9);
        soft.normalise(300, 0.05, 0.05);
        soft.sum_moments(&warped);
        let mut columns = vec![0.0; 41];
        for i in 0..37 {
            let slack = f64::from(soft.row_scale[i]) * 0.05;
            let sum: f64 = soft.entries(i).map(|(_, p)| p).sum();
            // Single-precision sums of 41 terms, at the fixed point of the sweeps.
            assert!(
                (sum + slack - 1.0).abs() < 1e-5 && (sum - soft.moments.weight[i]).abs() < 1e-5
            );
            soft.entries(i).for_each(|(j, p)| columns[j] += p);
        }
        for (c, &j) in soft.blocks.order.iter().enumerate() {
            assert!((columns[j] + f64::from(soft.column_scale[c]) * 0.05 - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn what_is_out_of_reach_makes_no_difference() {
        let (warped, mut soft) = scene();
        let (mut near, mut sparse) = (vec![vec![0.0_f64; 41]; 37], 0);
        for least in [1e-30, 1e-7] {
            soft.affinities(&warped, plain(0.01), least);
            soft.normalise(5, 0.01, 0.01);
            soft.sum_moments(&warped);
            sparse = sparse.max(37 * 3 - soft.active.len());
            for i in 0..37 {
                for (j, p) in soft.entries(i) {
                    // Forty affinities of 1e-7 each are dropped, compared with a slack of 1e-2.
                    assert!(least == 1e-30 || (p - near[i][j]).abs() < 4e-4);
                    near[i][j] = p;
                }
            }
        }
        assert!(sparse > 20, "blocks were left out: {sparse}");
    }
}

mod lanes {
    use super::super::*;

    #[test]
    fn exponential_is_single_precision() {
        for i in 0..2000 {
            let x = -0.043 * i as f32;
            let (found, expected) = (f64::from(exp(x)), f64::from(x).exp());
            // Two units in the last place of single precision. Below the normal range zero is
            // correct.
            assert!(
                (found - expected).abs() <= 2.4e-7 * expected + 1e-37,
                "{x}: {found} {expected}"
            );
        }
        assert_eq!(exp(f32::MIN), 0.0);
    }
}
