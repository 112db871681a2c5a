//! The hand.
/// Hand.
pub struct Hand; 
/// HP.
pub struct HandParameters;
