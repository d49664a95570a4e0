//! Choice among laws by an information criterion.

/// Why a law was chosen.
///
/// ```
/// use tactile_elasticity::curve::SelectionReason;
///
/// let says = |reason| match reason {
///     SelectionReason::BetterFit { margin } if margin > 10.0 => "decisive",
///     SelectionReason::BetterFit { .. } => "likely",
///     SelectionReason::MostGeneral { .. } => "the data cannot tell",
///     _ => "no choice",
/// };
/// assert_eq!(says(SelectionReason::MostGeneral { behind: 1.2 }), "the data cannot tell");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum SelectionReason {
    /// It was asked for.
    Asked,
    /// No other law applies.
    OnlyCandidate,
    /// Its AICc is lower than the next by this much.
    BetterFit {
        /// The margin; 10 is decisive.
        margin: f64,
    },
    /// Others fit as well (within 2 of the best AICc, by this much); this is the most general theory among them.
    MostGeneral {
        /// How far its AICc is above the best.
        behind: f64,
    },
}

/// AICc differences up to this one are no evidence (Burnham & Anderson 2002).
const NO_EVIDENCE: f64 = 2.0;

/// Candidates (the most general first) in the order of preference: the first that is within 2 of the lowest criterion, then the
/// others, ascending. The list must not be empty.
pub(crate) fn rank(criteria: &[f64]) -> (Vec<usize>, SelectionReason) {
    let lowest = criteria.iter().copied().fold(f64::INFINITY, f64::min);
    let chosen = criteria
        .iter()
        .position(|c| *c <= lowest + NO_EVIDENCE)
        .unwrap_or(0);
    let mut others: Vec<usize> = (0..criteria.len()).filter(|&k| k != chosen).collect();
    others.sort_by(|&i, &j| criteria[i].total_cmp(&criteria[j]));
    let reason = match others.first().map(|&k| criteria[k] - criteria[chosen]) {
        None => SelectionReason::OnlyCandidate,
        Some(margin) if margin > NO_EVIDENCE => SelectionReason::BetterFit { margin },
        Some(_) => SelectionReason::MostGeneral {
            behind: criteria[chosen] - lowest,
        },
    };
    others.insert(0, chosen);
    (others, reason)
}

/// The items in an order that names each once.
pub(crate) fn in_order<A>(items: Vec<A>, order: &[usize]) -> Vec<A> {
    let mut taken: Vec<_> = items.into_iter().map(Some).collect();
    order.iter().filter_map(|&k| taken[k].take()).collect()
}

/// exp(−Δ/2), divided by their sum (Akaike weights).
pub(crate) fn akaike_weights(criteria: impl Iterator<Item = f64> + Clone) -> Vec<f64> {
    let lowest = criteria.clone().fold(f64::INFINITY, f64::min);
    let likelihood: Vec<f64> = criteria.map(|c| (-0.5 * (c - lowest)).exp()).collect();
    let total: f64 = likelihood.iter().sum();
    likelihood.iter().map(|l| l / total).collect()
}
