// SPDX-License-Identifier: Apache-2.0
#include <windows.h>
// after it
#include <fcntl.h>
#include <io.h>
#include <psapi.h>
#include <shellapi.h>
#include <tlhelp32.h>

#include <system_error>

#include "system.hpp"

namespace pointfair::cli::system {
namespace fs = std::filesystem;
namespace {

HANDLE interrupted = nullptr;

BOOL WINAPI note_interrupt(DWORD event) {
  ::SetEvent(interrupted);
  // the system ends the process as soon as this returns, but after Ctrl-C and Ctrl-Break
  if (event != CTRL_C_EVENT && event != CTRL_BREAK_EVENT) ::Sleep(INFINITE);
  return TRUE;
}

std::string last_message() { return std::system_category().message(static_cast<int>(::GetLastError())); }

// Empty if it can be opened with these rights.
std::string why_not(const fs::path& path, DWORD rights) {
  const HANDLE handle = ::CreateFileW(path.c_str(), rights, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE,
                                      nullptr, OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, nullptr);
  if (handle == INVALID_HANDLE_VALUE) return last_message();
  ::CloseHandle(handle);
  return {};
}

// The process that started this one, or null.
HANDLE open_parent(int parent) {
  const HANDLE all = ::CreateToolhelp32Snapshot(TH32CS_SNAPPROCESS, 0);
  PROCESSENTRY32W entry{};
  entry.dwSize = sizeof entry;
  DWORD its = 0;
  for (BOOL more = ::Process32FirstW(all, &entry); more && its == 0; more = ::Process32NextW(all, &entry))
    if (entry.th32ProcessID == ::GetCurrentProcessId()) its = entry.th32ParentProcessID;
  ::CloseHandle(all);
  return its == static_cast<DWORD>(parent) ? ::OpenProcess(SYNCHRONIZE, FALSE, its) : nullptr;
}

}  // namespace

void prepare_streams() {
  for (const int stream : {0, 1, 2}) ::_setmode(stream, _O_BINARY);
  ::SetConsoleOutputCP(CP_UTF8);
}
bool errors_go_to_terminal() { return ::_isatty(2) != 0; }
int process_id() { return static_cast<int>(::GetCurrentProcessId()); }
fs::path program_file() {
  std::wstring name(1 << 15, L'\0');  // no path is longer
  name.resize(::GetModuleFileNameW(nullptr, name.data(), static_cast<DWORD>(name.size())));
  return name;
}

std::string why_not_writable(const fs::path& file) { return why_not(file, GENERIC_WRITE); }
std::string why_no_files_in(const fs::path& folder) { return why_not(folder, FILE_ADD_FILE); }

bool replaces_what_is_read() { return false; }  // it is mapped

std::uint64_t peak_memory() {
  PROCESS_MEMORY_COUNTERS counters{};
  return ::GetProcessMemoryInfo(::GetCurrentProcess(), &counters, sizeof counters) ? counters.PeakWorkingSetSize : 0;
}
void keep_no_freed_memory() {}

bool end_with_parent(int parent) {
  const HANDLE its = open_parent(parent);
  if (its == nullptr || ::WaitForSingleObject(its, 0) != WAIT_TIMEOUT) return false;
  std::thread([its] {
    ::WaitForSingleObject(its, INFINITE);
    end_process(1);
  }).detach();
  return true;
}

void open_browser(std::string url) { ::ShellExecuteA(nullptr, "open", url.c_str(), nullptr, nullptr, SW_SHOWNORMAL); }

void catch_interrupts() {
  interrupted = ::CreateEventW(nullptr, TRUE, FALSE, nullptr);
  ::SetConsoleCtrlHandler(note_interrupt, TRUE);
}
void wait_for_interrupt() { ::WaitForSingleObject(interrupted, INFINITE); }
void end_wait(std::thread&) { ::SetEvent(interrupted); }
bool pipe_is_broken() { return false; }
void catch_lost_files(void (*)(int)) {}
void end_process(int code, std::string_view) {
  ::TerminateProcess(::GetCurrentProcess(), static_cast<UINT>(code));
  ::Sleep(INFINITE);
  __builtin_unreachable();
}

}  // namespace pointfair::cli::system
