//! Frames that are read when a stage needs them give the same results as frames in memory.
use super::trial;
use tactile_imaging::pipeline::PipelineError;

#[test]
fn a_frame_on_demand_says_what_one_in_memory_says() {
    let trial = trial(&[0.7, 1.2], 4);
    let pipeline = trial.pipeline().unwrap();
    let mut lent = trial.press(&pipeline).unwrap();
    // The second frame twice: it counts once.
    lent.add_frame(trial.simulation.frames[1].view());
    let mut on_demand = pipeline.press(trial.simulation.reference.view()).unwrap();
    for index in [0, 1, 1] {
        let image = trial.simulation.frames[index].clone();
        on_demand.add_frame_on_demand(None, move || Ok(image.clone()));
    }
    assert_eq!(on_demand.modulus().unwrap(), lent.modulus().unwrap());
    assert_eq!(
        on_demand.strain(1).unwrap().field.clone(),
        lent.strain(1).unwrap().field
    );
}

#[test]
fn a_frame_that_can_no_longer_be_read_is_named() {
    let trial = trial(&[0.7], 4);
    let pipeline = trial.pipeline().unwrap();
    let mut press = pipeline.press(trial.simulation.reference.view()).unwrap();
    let gone = || Err("the file is gone".to_owned());
    press.add_frame_on_demand(None, gone);
    let error = press.contact(0).unwrap_err();
    let reason = "the file is gone".to_owned();
    assert_eq!(error, PipelineError::Unreadable { frame: 0, reason });
    assert_eq!(error.to_string(), "frame 0: the file is gone");
}
