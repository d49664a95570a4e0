//! Serialised values can be deserialised, with stable names.
use tactile_match::{
    Doubt, Judgement, MatchReport, Outliers, Rotation, Search, SoftMatches, StopReason,
};

#[test]
fn a_report_comes_back_as_it_was() {
    let mut report = MatchReport::default();
    report.stop = StopReason::IterationLimit;
    report.judgement = Judgement::Doubtful(Doubt::FewPairs);
    (report.residual, report.sigma) = (0.1, 0.3);
    let text = serde_json::to_string(&report).unwrap();
    assert!(text.contains(r#""stop":"iteration_limit""#), "{text}");
    assert_eq!(serde_json::from_str::<MatchReport>(&text).unwrap(), report);
}

#[test]
fn what_a_caller_says_of_a_scene_has_names() {
    let text = serde_json::to_string(&(Rotation::Any, Outliers::Target, Search::Near)).unwrap();
    assert_eq!(text, r#"["any","target","near"]"#);
    let read: (Rotation, Outliers, Search) = serde_json::from_str(&text).unwrap();
    assert_eq!(read, (Rotation::Any, Outliers::Target, Search::Near));
    assert!(serde_json::from_str::<Rotation>(r#""some""#).is_err());
}

#[test]
fn soft_matches_are_written_row_by_row() {
    let soft: SoftMatches = [[(3, 0.5), (1, 0.25)]].into_iter().collect();
    let text = serde_json::to_string(&soft).unwrap();
    assert_eq!(
        text,
        r#"{"starts":[0,2],"columns":[3,1],"weights":[0.5,0.25]}"#
    );
}
