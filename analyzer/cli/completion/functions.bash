# What completes the kinds of values. $1 is the word so far; the names stand in _tailbyte_names_KIND.

_tailbyte_words() { compgen -W "${!1}" -- "$2"; }

# A list with commas: its last part.
_tailbyte_list() {
  local before=
  [[ $2 == *,* ]] && before=${2%,*},
  compgen -P "$before" -W "${!1}" -- "${2##*,}"
}

# One part of a dotted name after the other, as of paths, until only one way is left.
_tailbyte_dotted() {
  compgen -W "${!1}" -- "$2" | awk -v n=${#2} '
    { i = index(substr($0, n + 1), "."); head = i ? substr($0, 1, n + i) : $0
      all[NR] = $0; if (!(head in seen)) { seen[head]; heads[++count] = head } }
    END { if (count == 1) for (k = 1; k <= NR; k++) print all[k]
          else for (k = 1; k <= count; k++) print heads[k] }'
}

_tailbyte_types() { _tailbyte_list _tailbyte_names_types "$1"; }
_tailbyte_rules() { _tailbyte_list _tailbyte_names_rules "$1"; }
_tailbyte_fields() { _tailbyte_dotted _tailbyte_names_fields "$1"; }
_tailbyte_terms() { _tailbyte_dotted _tailbyte_names_terms "$1"; }
_tailbyte_lexicon() { _tailbyte_words _tailbyte_names_lexicon "$1"; }
_tailbyte_tables() { _tailbyte_words _tailbyte_names_tables "$1"; }
_tailbyte_topics() { _tailbyte_words _tailbyte_names_topics "$1"; }
_tailbyte_origins() { _tailbyte_words _tailbyte_names_origins "$1"; }
_tailbyte_flights() { _tailbyte_words _tailbyte_names_flights "$1"; }
_tailbyte_scenarios() { _tailbyte_words _tailbyte_names_scenarios "$1"; }
_tailbyte_drivers() { _tailbyte_words _tailbyte_names_drivers "$1"; }
_tailbyte_gates() { _tailbyte_list _tailbyte_names_gates "$1"; }
_tailbyte_differences() { _tailbyte_list _tailbyte_names_differences "$1"; }

# A statistic, and names behind the commas where it takes them.
_tailbyte_statistics() {
  case $1 in
    values,* | io,*,*) _tailbyte_filters "$1" ;;
    *,*) ;;
    *) _tailbyte_words _tailbyte_names_statistics "$1" ;;
  esac
}

# What a field is compared with: the name, the operator, a quote, the value so far.
_tailbyte_compared='([A-Za-z_][A-Za-z0-9_.]*)[ ]*([=!]==?|[ ]eq|[ ]ne|[ ]in[ ]*[{]([^}]*,)?)[ ]*("?)([^]="!{},&|()\]*)$'

# The last name of a filter, which stands between quotes more often than not, or a value of it.
_tailbyte_filters() {
  local word=${1#[\'\"]} last line found
  if [[ $word =~ $_tailbyte_compared ]]; then
    line='"'; [[ $1 == \"* ]] && line=  # between double quotes a word stands as it is
    last=${BASH_REMATCH[5]} word=${word%"${BASH_REMATCH[4]}$last"}
    found=$(compgen -W "$_tailbyte_names_values" -- "${BASH_REMATCH[1]}=${last// /\~}")
    if [ -n "$found" ]; then
      while IFS= read -r last; do last=${last#*=}; printf '%s\n' "$word$line${last//\~/ }$line"; done <<< "$found"
      return
    fi
    word=${1#[\'\"]}
  fi
  last=${word##*[!A-Za-z0-9_.]}
  _tailbyte_dotted _tailbyte_names_terms "$last" | while IFS= read -r line; do printf '%s\n' "${word%"$last"}$line"; done
}

# Captures by their names, or any files if there are none.
_tailbyte_file_captures() {
  local found
  found=$(compgen -f -- "$1" | grep -iE "\.(${_tailbyte_names_suffixes// /|})(\.(gz|zst))?\$"; compgen -d -- "$1")
  if [ -n "$found" ]; then printf '%s\n' "$found"; else compgen -f -- "$1"; fi
}

_tailbyte_interfaces() {
  local one kind names=
  for one in /sys/class/net/*; do
    { read -r kind < "$one/type"; } 2> /dev/null && [ "$kind" = 280 ] && names+=" ${one##*/}"
  done
  compgen -W "$names" -- "$1"
}

_tailbyte_file_sources() {
  _tailbyte_file_captures "$1"
  _tailbyte_interfaces "$1"
}
