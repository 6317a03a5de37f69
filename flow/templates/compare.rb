
align
ENV["PORTS"].split(",").each { |port| same_nets!(ENV["CELL_NAME"], port, port.upcase) }
ok = compare
require "json"
circuit = netlist.circuit_by_name(ENV["CELL_NAME"])
differ = []
xref = lvs_data.xref
xref.each_circuit_pair do |pair|
    xref.each_net_pair(pair) do |nets|
        next if ok || nets.status == RBA::NetlistCrossReference::Match
        differ << [nets.first, nets.second].map { |net| net ? net.expanded_name : "none" }.join(" / ")
    end
end
File.write(ENV["COUNTS_FILE"], JSON.generate({
    "equal" => ok, "nets" => circuit.each_net.count, "devices" => circuit.each_device.count,
    "ports" => ENV["PORTS"].split(",").size, "differ" => differ.first(5)
}))
