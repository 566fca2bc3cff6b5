// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace pointfair::cuda {

// Throws Error(device) with the reason if this card cannot be used.
void require_card(int card);

}  // namespace pointfair::cuda
