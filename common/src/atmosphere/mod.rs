//! Signal delays in ionosphere and troposphere.
