//! Recordings in which an effect is concealed, for the proof. Shares no simulation code with the engine.
