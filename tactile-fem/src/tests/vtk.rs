use super::*;

/// The numbers after the line that begins with `title`.
fn block<'a>(text: &'a str, title: &str) -> impl Iterator<Item = f64> + 'a {
    let start = text.find(title).expect("a title");
    let lines = text[start..].lines().skip(1);
    let numbers = lines.flat_map(str::split_whitespace);
    numbers.map_while(|word| word.parse().ok())
}

#[test]
fn a_file_holds_mesh_displacements_and_stresses() {
    // A cylinder free to slide between plates, squeezed by a hundredth.
    let mesh = Mesh::rectangle(&[0.0, 1e-3, 2e-3], &[0.0, 1e-3]);
    let mut model = ElementModel::new(Kinematics::Linear);
    let body = model
        .add(&mesh, &[Material::new(1e5, 0.45).unwrap()])
        .unwrap();
    model.drive(body, Boundary::Base, Support::Sliding);
    model.hold(body, Boundary::Contact, Support::Sliding);
    let scene = FemScene::from_model(model);
    let state = &scene.solve(&[AppliedLoad::Approach(1e-5)]).states[0];
    let mut file = Vec::new();
    scene.write_vtk(state, &mut file).unwrap();
    let text = String::from_utf8(file).unwrap();
    let points: Vec<f64> = block(&text, "POINTS").collect();
    assert_eq!(points.len(), 3 * mesh.nodes.len());
    let displacements: Vec<f64> = block(&text, "VECTORS").collect();
    for (point, u) in points.chunks(3).zip(displacements.chunks(3)) {
        // The base rises by 10 µm, the top stays; the sides spread by ν of the strain. The
        // residual's tolerance is left.
        assert!((u[1] - 1e-5 * (1.0 - point[1] / 1e-3)).abs() < 1e-11);
        assert!((u[0] - 0.45e-2 * point[0]).abs() < 1e-11);
    }
    let stresses: Vec<f64> = block(&text, "TENSORS").collect();
    assert_eq!(stresses.len(), 9 * scene.element_count());
    assert!(
        stresses
            .chunks(9)
            .all(|s| (s[4] + 1e3).abs() < 1e-3 && s[0].abs() < 1e-3)
    );
    assert_eq!(block(&text, "CELL_TYPES").count(), scene.element_count());
}

#[test]
fn a_state_of_another_scene_is_refused() {
    let gel = Material::new(1e5, 0.495).unwrap();
    let ball = ObjectPress::new(ObjectShape::Ball { radius_m: 3e-3 }, gel).unwrap();
    let [scene, other] = [3, 4].map(|n| ball.clone().with_fineness(n).unwrap().scene().unwrap());
    let state = &scene.solve(&[AppliedLoad::Approach(1e-4)]).states[0];
    assert!(other.write_vtk(state, &mut Vec::new()).is_err());
}
