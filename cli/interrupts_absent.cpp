// SPDX-License-Identifier: Apache-2.0
// In place of interrupts.cpp where there are no signals.
#include "interrupts.hpp"

namespace pointfair::cli {

Interrupts::Interrupts() = default;
Interrupts::~Interrupts() = default;
void Interrupts::finish() {}
void remove_if_ended(const std::filesystem::path&) {}

}  // namespace pointfair::cli
