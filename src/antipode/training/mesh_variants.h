#pragma once

#include <functional>
#include <random>

#include "antipode/render/mesh.h"

namespace antipode {

/// New training objects from those at hand: their poses stay as observable, their looks do not repeat.
/// All depend on the state of `random` only and give the same meshes on every platform.

/// Stretched along its axes by independent log-uniform factors, at most `greatest` between two of them.
Mesh RandomlyStretched(const Mesh& mesh, double greatest, std::mt19937_64& random);

/// Every material gets a new base colour, and in half of the cases a texture of `donor` (if it has one),
/// projected along the axis that each triangle faces most. Vertex colours are dropped.
Mesh RandomlyRetextured(const Mesh& mesh, const Mesh& donor, std::mt19937_64& random);

/// `mesh` joined with `other`, which is scaled by 0.4 to 0.9, turned about the up axis and moved by up to the
/// sum of both radii, so that the parts touch or overlap; then Normalize()d.
Mesh RandomlyJoined(const Mesh& mesh, const Mesh& other, std::mt19937_64& random);

/// Kinds of variants, in turn: 0 the object itself; then stretched, stretched and retextured, stretched and joined, and so on.
/// @param load_donor called only for the kinds that need another object
Mesh RandomVariant(int kind, const Mesh& mesh, const std::function<Mesh()>& load_donor, double greatest_stretch, std::mt19937_64& random);

}  // namespace antipode
