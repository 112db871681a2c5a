//! `haply-accept ws://127.0.0.1:10001/`: the client reads the mock, pushes, and sees the force.

use haply::device_model::{Force, ForceInput};
use haply::HaplyDevice;
use std::time::Duration;

#[tokio::main]
async fn main() {
    let url = std::env::args().nth(1).expect("the address of the mock");
    let mut device = HaplyDevice::new("http://127.0.0.1:1", &url).await.expect("a connection");
    tokio::time::sleep(Duration::from_millis(300)).await;
    let first = device.read_state().await.expect("the inventory");
    assert_eq!(first.inverse3.len(), 1, "{first:?}");
    let own = &first.inverse3[0];
    assert!(own.status.calibrated && own.config.is_some(), "{own:?}");
    assert!(own.state.cursor_position.is_some() && own.state.cursor_velocity.is_some());
    let id = own.device_id.clone();
    for _ in 0..50 {
        let force = ForceInput { device_id: id.clone(), forces: Force { x: 1.5, y: 0.0, z: 0.0 } };
        device.update_force(vec![force], Some(true), Some(true)).await.expect("a command");
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    let state = device.read_state().await.expect("a state");
    let force = state.inverse3[0].state.current_cursor_force.expect("a force");
    assert!((force.x - 1.5).abs() < 1e-5, "{force:?}");
    println!("haply 1.3.1: the client accepts the mock, device {id}");
}
