#pragma once

namespace antipode {

/// Seconds since the system started this process, so that loading its libraries counts.
double SecondsSinceProcessStart();

}  // namespace antipode
