// SPDX-License-Identifier: Apache-2.0
// What the program asks of the system, which systems call differently.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <thread>

namespace pointfair::cli::system {

/// Bytes of standard output go out as they are, text on terminals is UTF-8, and a stream that is closed stays so.
void prepare_streams();

/// Whether standard error is shown to somebody.
bool errors_go_to_terminal();

int process_id();
/// The file of this program.
std::filesystem::path program_file();

/// Why the program may not write to the file, or create files in the folder; empty if it may.
std::string why_not_writable(const std::filesystem::path& file);
std::string why_no_files_in(const std::filesystem::path& folder);

/// Whether a file can be replaced while it is read.
bool replaces_what_is_read();

/// Memory that the process held at most so far, in bytes; 0 where the system does not count it.
std::uint64_t peak_memory();

/// Has freed memory returned to the system at once. To be called before anything large is allocated.
void keep_no_freed_memory();

/// From now on this process ends when the one that started it ends. False if that, which has the id `parent`, is gone.
bool end_with_parent(int parent);

/// Opens the address in a browser, if there is a screen.
void open_browser(std::string url);

/// Interrupts no longer end the process: they are what the next call waits for. Before any other thread is made.
void catch_interrupts();
void wait_for_interrupt();
/// Ends the wait of that thread.
void end_wait(std::thread& waiting);
/// Whether a write met a pipe that nobody reads any more, which ends no process after catch_interrupts().
bool pipe_is_broken();
/// Has the handler called where a file that is mapped became shorter in place, or its disk went away. It may call what
/// the handler of a signal may.
void catch_lost_files(void (*handler)(int));
/// Ends the process without any further step but these words on standard error. A handler may call it.
[[noreturn]] void end_process(int code, std::string_view last_words = {});

}  // namespace pointfair::cli::system
