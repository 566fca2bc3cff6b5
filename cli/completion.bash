# SPDX-License-Identifier: Apache-2.0
# Completion for bash, and for zsh after "autoload -U compinit bashcompinit; compinit; bashcompinit". What it offers is what the
# program's own help lists, so it fits every version: verbs, options, and values that are words; elsewhere files.
_pointfair_help() {
  "$@" --help-all 2> /dev/null || "$@" --help 2> /dev/null
}

_pointfair_verbs() {
  sed -n '/^[Ss][Uu][Bb][Cc][Oo][Mm][Mm][Aa][Nn][Dd][Ss]:/,$s/^  *\([a-z][a-z]*\)  .*/\1/p' <<< "$1"
}

_pointfair() {
  local program="${COMP_WORDS[0]/#\~/$HOME}" word="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD-1]}" text offers=""
  # bash splits --option=value in three
  if [[ $before == "=" ]]; then before="${COMP_WORDS[COMP_CWORD-2]}"; fi
  if [[ $word == "=" ]]; then word=""; fi
  if ((COMP_CWORD == 1)); then
    offers="$("$program" --help 2> /dev/null | sed -n 's/^  pointfair \([a-z]*\) .*/\1/p') --help --version"
  else
    text="$(_pointfair_help "$program" "${COMP_WORDS[1]}")"
    offers="$(_pointfair_verbs "$text")"
    if [[ -n $offers ]] && ((COMP_CWORD > 2)); then
      text="$(_pointfair_help "$program" "${COMP_WORDS[1]}" "${COMP_WORDS[2]}")"
      offers=""
    fi
    if [[ $word == -* ]]; then
      offers="$(sed -n 's/^  *\(-.,\)\{0,1\} *\(--[a-z0-9-]*\).*/\2/p' <<< "$text")"
    elif [[ $before == --* && $before != *[^a-z0-9-]* ]]; then  # values as one|another
      offers="$(sed -n "s/^  *\(-.,\)\{0,1\} *$before \([^ ]*\).*/\2/p" <<< "$text" | tr '|' '\n' | sed -n 's/^\([a-z][a-z0-9-]*\)\(\[.*\]\)\{0,1\}$/\1/p')"
    fi
  fi
  COMPREPLY=($(compgen -W "$offers" -- "$word"))
}
complete -o bashdefault -o default -F _pointfair pointfair
