# What completes the kinds of values. The names stand in _tailbyte_names_KIND.

_tailbyte_words() { compadd -- ${=1} }

# A list with commas: its last part.
_tailbyte_list() { compset -P '*,'; compadd -S '' -- ${=1} }

# One part of a dotted name after the other, as of paths.
_tailbyte_dotted() { local -a names; names=(${=1}); _multi_parts . names }

_tailbyte_types() { _tailbyte_list "$_tailbyte_names_types" }
_tailbyte_rules() { _tailbyte_list "$_tailbyte_names_rules" }
_tailbyte_fields() { _tailbyte_dotted "$_tailbyte_names_fields" }
_tailbyte_terms() { _tailbyte_dotted "$_tailbyte_names_terms" }
_tailbyte_lexicon() { _tailbyte_words "$_tailbyte_names_lexicon" }
_tailbyte_tables() { _tailbyte_words "$_tailbyte_names_tables" }
_tailbyte_topics() { _tailbyte_words "$_tailbyte_names_topics" }
_tailbyte_origins() { _tailbyte_words "$_tailbyte_names_origins" }
_tailbyte_flights() { _tailbyte_words "$_tailbyte_names_flights" }
_tailbyte_scenarios() { _tailbyte_words "$_tailbyte_names_scenarios" }
_tailbyte_drivers() { _tailbyte_words "$_tailbyte_names_drivers" }
_tailbyte_gates() { _tailbyte_list "$_tailbyte_names_gates" }
_tailbyte_differences() { _tailbyte_list "$_tailbyte_names_differences" }

# A statistic, and names behind the commas where it takes them.
_tailbyte_statistics() {
  if compset -P 'values,' || compset -P 'io,*,'; then _tailbyte_filters
  elif [[ $PREFIX != *,* ]]; then _tailbyte_words "$_tailbyte_names_statistics"
  fi
}

# What a field is compared with: the name, the operator, a quote, the value so far.
_tailbyte_compared='([A-Za-z_][A-Za-z0-9_.]*)[ ]*([=!]==?|[ ]eq|[ ]ne|[ ]in[ ]*[{]([^}]*,)?)[ ]*("?)([^]="!{},&|()]*)$'

# The last name of a filter, or a value of it.
_tailbyte_filters() {
  local -a found match mbegin mend
  local open
  if [[ $PREFIX =~ $_tailbyte_compared ]]; then
    found=(${(M)${=_tailbyte_names_values}:#${match[1]}=*})
    if (( $#found )); then
      found=(${${found#*=}//\~/ })
      open=${match[4]:-\"}
      compset -p $(( $#PREFIX - $#match[4] - $#match[5] ))
      compadd -S '' -- $open${^found}\"
      return
    fi
  fi
  compset -P '*[^A-Za-z0-9_.]'
  _tailbyte_dotted "$_tailbyte_names_terms"
}

# Captures by their names, or any files if there are none.
_tailbyte_file_captures() { _files -g "*.(${_tailbyte_names_suffixes// /|})(|.gz|.zst)(-.)" }

_tailbyte_interfaces() {
  local one kind
  local -a names
  for one in /sys/class/net/*(N); do
    { read -r kind < $one/type } 2> /dev/null && [[ $kind == 280 ]] && names+=(${one:t})
  done
  compadd -a names
}

_tailbyte_file_sources() { _tailbyte_interfaces; _tailbyte_file_captures }
