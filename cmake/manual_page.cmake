# SPDX-License-Identifier: Apache-2.0
# The manual page, made of what the program says of itself: cmake -DPROGRAM=FILE -DPAGE=FILE -P manual_page.cmake
# help2man makes a page of one text of help, the program has one for each verb, and CMake is wherever it is built.
cmake_minimum_required(VERSION 3.25)

function(ask_for_help into)
  foreach(option --help-all --help)  # few verbs have more to say
    execute_process(COMMAND ${PROGRAM} ${ARGN} ${option} OUTPUT_VARIABLE text ERROR_QUIET RESULT_VARIABLE code)
    if(code STREQUAL "0")
      set(${into} "\n${text}" PARENT_SCOPE)
      return()
    endif()
  endforeach()
  message(FATAL_ERROR "${PROGRAM} ${ARGN} --help fails: ${code}")
endfunction()

# Two columns become a name and a paragraph; a line at the margin that ends with a colon is a heading.
function(roff_of into text)
  string(REPLACE "\\" "\\e" text "${text}")
  string(REGEX REPLACE "([ \n])([.'])" "\\1\\\\&\\2" text "${text}")
  string(REGEX REPLACE "\n  +(-.,) *--" "\n  \\1--" text "${text}")  # newer CLI11 sets short options apart
  string(REGEX REPLACE "\n  +--" "\n  --" text "${text}")
  string(REPEAT "[^\n]" 26 inside)  # where a name fills its column, one blank is left between the two
  string(REGEX REPLACE "\n  ([^ \n]${inside}) ([^ \n])" "\n  \\1  \\2" text "${text}")
  string(REGEX REPLACE "\n+([^ \n][^\n]*):\n" "\n.SS \\1\n" text "${text}")
  string(REGEX REPLACE "\n  ([^ \n]+( [^ \n]+)*)(  +|\n   +)([^\n]+)" "\n.TP\n\\\\fB\\1\\\\fR\n\\4" text "${text}")
  string(REGEX REPLACE "\n(\n+|Usage)" "\n.PP\n\\1" text "${text}")
  string(REGEX REPLACE "\n\n+" "\n" text "${text}")
  string(REGEX REPLACE "\n +" "\n" text "${text}")
  string(REPLACE "-" "\\-" text "${text}")
  string(REPLACE "|" "|\\:" text "${text}")  # lines may break there
  set(${into} "${text}" PARENT_SCOPE)
endfunction()

ask_for_help(help)
string(REGEX MATCH "^\npointfair ([^:]+): ([^\n]+)(\n.*)" _ "${help}")
set(version ${CMAKE_MATCH_1})
set(does ${CMAKE_MATCH_2})
roff_of(overview "${CMAKE_MATCH_3}")
set(page ".TH POINTFAIR 1 \"\" \"pointfair ${version}\" \"User Commands\"\n")
string(APPEND page ".SH NAME\npointfair \\- ${does}\n.SH SYNOPSIS\n\\fBpointfair\\fR VERB [OPTIONS] FILES\n.SH DESCRIPTION${overview}")
string(REGEX MATCHALL "\n  pointfair [a-z]+" verbs "${help}")
list(REMOVE_DUPLICATES verbs)
while(verbs)
  list(POP_FRONT verbs verb)
  string(REGEX MATCHALL "[a-z]+" words "${verb}")
  list(POP_FRONT words)
  ask_for_help(help ${words})
  if(help MATCHES "\nS[Uu][Bb][Cc][Oo][Mm][Mm][Aa][Nn][Dd][Ss]:(\n.*)")
    string(REGEX MATCHALL "\n  [a-z]+" subverbs "${CMAKE_MATCH_1}")
    list(TRANSFORM subverbs PREPEND "${verb}")
    list(PREPEND verbs ${subverbs})
  endif()
  roff_of(text "${help}")
  string(JOIN " " title pointfair ${words})
  string(TOUPPER "${title}" title)
  string(APPEND page ".SH \"${title}\"${text}")
endwhile()
file(WRITE ${PAGE} "${page}")
